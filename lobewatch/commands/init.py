"""lobewatch init."""

from __future__ import annotations

import json
import shlex
from importlib import resources
from pathlib import Path
from typing import Annotated

import typer

from acquisition import DataError, atomic_write, check_name
from lobewatch.machine.named_folder import named_folder
from lobewatch.show.output import Json, emit


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
    toml = make_machine_folder(machine, "surrogate_machine.toml" if example else "new_machine.toml")
    emit(
        {"machine": str(machine), "machine_toml": str(toml)},
        as_json,
        f"made {toml}",
        f"next: fill it in, then tap with: lobewatch tap {shlex.quote(str(machine))} --port PORT",
    )


def make_machine_folder(folder: Path, template: str) -> Path:
    """A machine folder from a template of sim_data, named after itself; DataError where there is one already.

    ValueError for a folder whose name holds control characters.
    """
    name = folder.resolve().name or "machine"  # the root of a disk has no name
    check_name(name, "folder")
    toml = folder / "machine.toml"
    if toml.exists():
        raise DataError(f"{toml}: is there already; choose another folder or edit that file")
    folder.mkdir(parents=True, exist_ok=True)
    text = resources.files("sim_data").joinpath(template).read_text(encoding="utf-8")
    quoted = json.dumps(name, ensure_ascii=False)  # TOML escapes as JSON does
    atomic_write(toml, text.replace('"MACHINE_NAME"', quoted).encode())
    return toml
