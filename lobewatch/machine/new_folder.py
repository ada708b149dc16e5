"""A new machine folder. Imports nothing heavy: `lobewatch init` is quick."""

from __future__ import annotations

import json
from importlib import resources
from pathlib import Path

from acquisition.atomic import atomic_write, make_folder
from acquisition.errors import DataError
from acquisition.names import check_name


def make_machine_folder(folder: Path, template: str) -> Path:
    """A machine folder from a template of sim_data, named after itself; DataError where there is one already.

    ValueError for a folder whose name holds control characters.

    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as parent:
    ...     toml = make_machine_folder(Path(parent) / "mill-3", "surrogate_machine.toml")
    ...     machine = MachineFolder(toml.parent).machine
    >>> machine.machine.name, [program.name for program in machine.program]
    ('mill-3', ['A: slot at 12 600 rpm', 'B: slot at 6 200 rpm', 'C: slot at 16 000 rpm'])
    """
    return write_machine(folder, new_machine_text(folder, template))


def new_machine_text(folder: Path, template: str) -> str:
    """Text of the machine.toml of a folder to be made; DataError where there is one already."""
    name = folder.resolve().name or "machine"  # the root of a disk has no name
    check_name(name, "folder")
    toml = folder / "machine.toml"
    if toml.exists():
        raise DataError(f"{toml}: is there already; choose another folder or edit that file")
    text = resources.files("sim_data").joinpath(template).read_text(encoding="utf-8")
    quoted = json.dumps(name, ensure_ascii=False)  # TOML escapes as JSON does
    return text.replace('"MACHINE_NAME"', quoted)


def write_machine(folder: Path, text: str) -> Path:
    """Write the machine.toml of a folder, which is made where it is not there."""
    make_folder(folder)
    toml = folder / "machine.toml"
    atomic_write(toml, text.encode())
    return toml
