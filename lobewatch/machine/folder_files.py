"""Name, watch and create the files of a machine folder without heavy imports."""

from __future__ import annotations

import json
import os
from importlib import resources
from pathlib import Path

from acquisition.errors import DataError, check_name
from acquisition.file_io import atomic_write, make_folder

WATCHED_FILES = ("machine.toml", "journal.jsonl", "journal.copy.jsonl", "taps")
"""Names in the folder of a machine whose change is a change of what is known of it."""


def to_folder_path(name: Path | str) -> Path:
    """Path of the folder that a person names; FileNotFoundError for an empty name.

    Python takes that for the current folder: mostly a slip.
    """
    if not str(name):
        raise FileNotFoundError("the name of the folder is empty; give the machine folder, or . for the current one")
    return Path(name)


def format_path(path: Path | str) -> str:
    """Path as a text that every file and page can hold: what of it is no UTF-8 stands there as escaped."""
    return str(path).encode("utf-8", "backslashreplace").decode()


def compute_change_mark(folder: Path, file: str = "") -> tuple[int, ...]:
    """Changes with machine.toml, the journal, the names in taps/, and a file in the folder where one is named."""
    stats = []
    for name in (*WATCHED_FILES, file) if file else WATCHED_FILES:
        try:
            stats.append(os.stat(f"{folder}/{name}"))  # noqa: PTH116 - of hundreds of machines at every look
        except OSError:
            continue
    return tuple(number for stat in stats for number in (stat.st_mtime_ns, stat.st_size, stat.st_ino))


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
    return write_machine_file(folder, make_machine_text(folder, template))


def make_machine_text(folder: Path, template: str) -> str:
    """Text of the machine.toml of a folder to be made; DataError where there is one already."""
    name = folder.resolve().name or "machine"  # the root of a disk has no name
    check_name(name, "folder")
    toml = folder / "machine.toml"
    if toml.exists():
        raise DataError(f"{toml}: is there already; choose another folder or edit that file")
    text = resources.files("sim_data").joinpath(template).read_text(encoding="utf-8")
    quoted = json.dumps(name, ensure_ascii=False)  # TOML escapes as JSON does
    return text.replace('"MACHINE_NAME"', quoted)


def write_machine_file(folder: Path, text: str) -> Path:
    """Write the machine.toml of a folder, which is made where it is not there."""
    make_folder(folder)
    toml = folder / "machine.toml"
    atomic_write(toml, text.encode())
    return toml
