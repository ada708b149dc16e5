"""A program written into machine.toml, comments and order as they are."""

from __future__ import annotations

from typing import Any

import msgspec

from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.new_folder import write_machine
from lobewatch.machine.settings.cut_tables import ProgramTable
from lobewatch.machine.settings.edit_text import TablePlace, edit_text
from lobewatch.machine.settings.machine_file import REFERENCE_CUT, Machine, parse_machine

FIRST = ("name", "tool")
"""Keys that stand first; the others as `ProgramTable` has them."""


def refuse_taken(machine: Machine, name: str) -> None:
    """ValueError for a name that no new program can have."""
    if not name.strip():
        raise ValueError("--save: the name is empty; give the program a name")
    if name in (REFERENCE_CUT, *(program.name for program in machine.listed)):
        raise ValueError(f"--save {name}: a program of that name is in machine.toml; choose another name")


def save_program(folder: MachineFolder, program: ProgramTable) -> None:
    """Add a program behind the others; ValueError for a taken name, DataError where the file cannot be edited.

    Nothing is written unless all of the file can be read again.
    """
    with folder.locked():
        now = MachineFolder(folder.path)
        refuse_taken(now.machine, program.name)
        place = TablePlace("program", len(now.machine.listed))
        text = edit_text(now.toml_text, place, _values(program))
        parse_machine(text, str(now.toml))
        write_machine(now.path, text)


def _values(program: ProgramTable) -> dict[str, Any]:
    """Name and tool, and what differs from the defaults."""
    given = {
        field.name: getattr(program, field.name)
        for field in msgspec.structs.fields(program)
        if field.name in FIRST or getattr(program, field.name) != field.default
    }
    return {key: given[key] for key in (*FIRST, *given) if key in given}
