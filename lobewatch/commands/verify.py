"""lobewatch verify."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lobewatch.machine.folder_path import named_folder
from lobewatch.show.terminal.output import Json, emit


def verify(
    machine: Annotated[Path, typer.Argument(parser=named_folder, help="Machine folder.")],
    as_json: Json = False,
) -> None:
    """Every byte of a machine folder against what was written; exit code 1 where something is damaged.

    Names every file that is altered, missing, extra, swapped, renamed or cut short, and what to do. A machine.toml that
    was edited is told, and is no damage. Nothing is changed, but that a tap test which an ended program had stored and
    not yet entered in the journal is entered.

    Examples:

      lobewatch verify mill-3
    """
    from lobewatch.machine.archive.verify import verify as verified
    from lobewatch.show.terminal.remarks import remark_json

    found = verified(machine)
    others = [remark for remark in found.remarks if remark not in found.damage]
    payload = {
        "damage": [remark_json(remark) for remark in found.damage],
        "remarks": [remark_json(remark) for remark in others],
        "adopted": found.adopted,
        "sound_taps": found.n_taps,
    }
    texts = [*(f"damaged: {one}" for one in found.damage), *(f"note: {one}" for one in others)]
    texts += [f"entered in the journal: {name}" for name in found.adopted]
    last = f"{len(found.damage)} damaged" if found.damage else "nothing is damaged"
    emit(payload, as_json, *texts, f"{found.n_taps} tap test(s) as they were committed, {last}")
    if found.damage:
        raise typer.Exit(1)
