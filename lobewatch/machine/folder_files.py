"""Name, watch and create the files of a machine folder without heavy imports."""

import json
import os
from importlib import resources
from pathlib import Path

from acquisition.errors import DataError, check_name
from acquisition.file_io import check_file_name, make_folder
from lobewatch.machine.journal.file_names import (
    CONFLICTS_FOLDER_NAME,
    JOURNAL_COPY_NAME,
    JOURNAL_NAME,
    list_foreign_names,
)
from lobewatch.machine.settings.toml import write_toml_text

WATCHED_FILES = ("machine.toml", JOURNAL_NAME, JOURNAL_COPY_NAME, "taps", "cuts", CONFLICTS_FOLDER_NAME)
"""Names whose change means a change of the machine data."""


def to_folder_path(name: Path | str) -> Path:
    """Return the path of a named folder; FileNotFoundError for an empty name, usually a mistake."""
    if not str(name):
        raise FileNotFoundError("the folder name is empty. Give the machine folder, or . for the current one.")
    return Path(name)


def compute_change_mark(folder: Path, file: str = "") -> tuple[int, ...]:
    """Return a mark that changes with machine.toml, the journal, the names in taps/, foreign files, and one more."""
    stats = []
    for name in (*WATCHED_FILES, *list_foreign_names(folder), *filter(None, [file])):
        try:
            stats.append(os.stat(f"{folder}/{name}"))  # noqa: PTH116 - of hundreds of machines at every look
        except OSError:
            continue
    return tuple(number for stat in stats for number in (stat.st_mtime_ns, stat.st_size, stat.st_ino))


def make_machine_folder(folder: Path, template: str) -> Path:
    """Make a machine folder from a template of sim_data, named after itself.

    Parameters
    ----------
    folder
        New folder.
    template
        File name of the template.

    Returns
    -------
    Path
        The new machine.toml.

    Raises
    ------
    DataError
        If there is a machine.toml already.
    ValueError
        If the name contains control characters, or Windows cannot store it.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as parent:
    ...     toml = make_machine_folder(Path(parent) / "mill-3", "surrogate_machine.toml")
    ...     machine = MachineFolder(toml.parent).machine
    >>> machine.machine.name, [program.name for program in machine.program]
    ('mill-3', ['A: slot at 12 600 rpm', 'B: slot at 6 200 rpm', 'C: slot at 16 000 rpm'])
    """
    text, toml = make_machine_text(folder, template), folder / "machine.toml"
    make_folder(folder)
    write_toml_text(toml, text)
    return toml


def make_machine_text(folder: Path, template: str) -> str:
    """Return the text of a new machine.toml; DataError if there is one already."""
    name = folder.resolve().name or "machine"  # the root of a disk has no name
    check_name(name, "folder")
    check_file_name(folder.resolve())
    refuse_machine_file(folder)
    text = resources.files("sim_data").joinpath(template).read_text(encoding="utf-8")
    quoted = json.dumps(name, ensure_ascii=False)  # TOML escapes as JSON does
    return text.replace('"MACHINE_NAME"', quoted)


def refuse_machine_file(folder: Path) -> None:
    """Raise DataError if the folder has a machine.toml already."""
    toml = folder / "machine.toml"
    if toml.exists():
        raise DataError(f"{toml}: file already exists. Choose another folder, or edit this file.")
