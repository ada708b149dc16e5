"""lobewatch init."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from lobewatch.machine.folder_path import named_folder
from lobewatch.show.terminal.output import Json, emit


def init(
    machine: Annotated[Path, typer.Argument(parser=named_folder, help="The folder to make.")],
    example: Annotated[bool, typer.Option("--example", help="With the surrogate spindle and three programs.")] = False,
    as_json: Json = False,
) -> None:
    """Make a machine folder with a commented machine.toml to fill in.

    Examples:

      lobewatch init mill-3
      lobewatch init trial --example
    """
    from lobewatch.machine.new_folder import make_machine_folder

    toml = make_machine_folder(machine, "surrogate_machine.toml" if example else "new_machine.toml")
    emit(
        {"machine": str(machine), "machine_toml": str(toml)},
        as_json,
        f"made {toml}",
        f"next: fill it in, then tap with: lobewatch tap {shlex.quote(str(machine))} --port PORT",
    )
