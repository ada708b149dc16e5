"""Command `lobewatch materials`: list materials with their cutting coefficients."""

from typing import Annotated

from typer import Argument

from lobewatch.show.terminal.output import Json, emit


def materials(
    word: Annotated[str, Argument(help="Part of a name (C45, 1.7225, AISI 4140), or a group: P, M, K, N, S, H.")] = "",
    as_json: Json = False,
) -> None:
    """List materials with their cutting coefficients.

    Use any name of a material in machine.toml, such as material = "42CrMo4" or "AISI 4140". Case and blanks in a
    name do not matter.

    Examples
    --------
      lobewatch materials
      lobewatch materials 4140
      lobewatch materials S --json
    """
    from lobes import find_materials
    from lobewatch.show.programs.materials import material_json, material_texts

    known = find_materials(word)
    emit({"materials": [material_json(one) for one in known]}, as_json, *material_texts(known))
