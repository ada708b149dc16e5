"""Create and change machine.toml without losing the changes of other programs and persons."""

from collections.abc import Callable, Sequence
from pathlib import Path

from acquisition import DataError
from acquisition.errors import join_sentences
from acquisition.file_io import make_folder
from lobewatch.machine.folder_files import refuse_machine_file
from lobewatch.machine.folder_lock import LOCK_TIMEOUT, FolderLock
from lobewatch.machine.settings.toml import KeyConflict, find_key_conflicts, read_toml_text, write_toml_text


def create_machine_file(folder: Path, text: str) -> None:
    """Write the machine.toml of a folder, which is made if necessary. DataError if there is a machine.toml already."""
    make_folder(folder)
    with FolderLock(folder).hold(LOCK_TIMEOUT):
        refuse_machine_file(folder)
        write_toml_text(folder / "machine.toml", text)


def change_machine_file(
    folder: Path,
    edit: Callable[[str], str],
    seen: str = "",
    may_overwrite: Callable[[Sequence[KeyConflict]], bool] = lambda _: False,
) -> None:
    """Change machine.toml under the lock, from its present text.

    edit: returns the wanted text for the present one. seen: text that a person answered to, if any. may_overwrite: asks
    about keys that changed after that, without the lock. Raises DataError, and writes nothing, if it returns False.
    """
    toml = folder / "machine.toml"
    while True:
        with FolderLock(folder).hold(LOCK_TIMEOUT):
            present = read_toml_text(toml)
            wanted = edit(present)
            conflicts = find_key_conflicts(seen or present, present, wanted)
            if not conflicts:
                if wanted != present:
                    write_toml_text(toml, wanted)
                return
        if not may_overwrite(conflicts):
            finding = f"{toml}: nothing written, because {', '.join(map(str, conflicts))}"
            raise DataError(join_sentences(finding, "Repeat the command to overwrite the value in the file"))
        seen = present
