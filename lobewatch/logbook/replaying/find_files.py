"""The files that a person means: files, folders and patterns."""

from __future__ import annotations

import glob
from collections.abc import Sequence
from pathlib import Path

from acquisition import DataError, known_formats
from acquisition.files.readers.text import is_prose


def find_files(places: Sequence[Path | str]) -> tuple[list[Path], list[Path]]:
    """Each file once, those of a folder and all below it by name, and those of folders that are passed over.

    Passed over is what lies in a folder and has an extension that no known format has, or is a text without a row of
    numbers; what is named is taken.
    DataError for a folder or a pattern without any file; a name is taken as it is, whether or not it is there.
    """
    files, passed_over = dict[Path, None](), list[Path]()
    for place in places:
        path = Path(place)
        if path.is_dir():
            taken, left = _in_folder(path)
            files |= dict.fromkeys(taken)
            passed_over += left
        elif path.exists() or not glob.has_magic(str(place)):
            files[path] = None
        else:
            files |= dict.fromkeys(_matching(str(place)))
    return list(files), passed_over


def _in_folder(folder: Path) -> tuple[list[Path], list[Path]]:
    files = sorted(file for file in folder.rglob("*") if file.is_file() and not _is_hidden(file.relative_to(folder)))
    extensions = {extension for file_format in known_formats() for extension in file_format.extensions}
    taken = [file for file in files if file.suffix.lower() in extensions and not is_prose(file)]
    if not taken:
        kinds = ", ".join(sorted(extensions))
        raise DataError(f"{folder}: none of the {len(files)} files in this folder is a recording (looked for {kinds})")
    left = set(files).difference(taken)
    return taken, [file for file in files if file in left]


def _is_hidden(path: Path) -> bool:
    return any(part.startswith(".") for part in path.parts)


def _matching(pattern: str) -> list[Path]:
    names = glob.glob(pattern, recursive=True)  # noqa: PTH207 - that of pathlib takes no absolute pattern
    files = sorted(path for path in map(Path, names) if path.is_file())
    if not files:
        raise DataError(f"{pattern}: no file matches this pattern")
    return files
