"""Recorded files made ready to be stored, each by itself: tap files under temporary names, and the modes in them.

Nothing of it depends on another file, so several processes can share the work; what they find is equal bit by bit.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from datetime import datetime
from multiprocessing import get_context
from pathlib import Path

from acquisition import DataError, Description, TapTest
from acquisition.atomic import make_folder
from acquisition.files.tap_file import as_written, tap_content
from lobewatch.analysis.measurement import Fitted, fitted
from lobewatch.analysis.replaying.read_tap_test import read_tap_test
from lobewatch.machine import MachineFolder, TapEntry

CHUNK = 4
"""Files that a process is given at a time."""


@dataclass(frozen=True, eq=False)
class Prepared:
    """One file."""

    digest: str
    """SHA-256 of the file."""
    temporary: Path
    """Its tap file, on the disk."""
    entry: TapEntry
    """Of that."""
    created: datetime
    """When it was recorded."""
    fit: Fitted
    """The modes in it."""
    taken: tuple[str, ...]
    """What was taken for granted where the file does not say it."""


def prepared(folder: MachineFolder, file: Path, said: Description) -> Prepared:
    """One file; DataError, OSError or ValueError where it cannot be used."""
    content = file.read_bytes()
    tap, recording = read_tap_test(folder, file, said, content)
    told = tuple(f"{fact.name} {fact.value}" for fact in recording.facts if fact.origin == "default")
    temporary, packed = _written(folder.path / "taps", tap)
    entry, fit = TapEntry.of(tap, packed), fitted(as_written(tap), folder.machine)
    return Prepared(hashlib.sha256(content).hexdigest(), temporary, entry, tap.circumstances.created, fit, told)


def all_prepared(
    folder: MachineFolder, files: Sequence[Path], said: Description, jobs: int = 1
) -> Iterator[Prepared | str]:
    """Each file in turn, or why it cannot be used; jobs: processes that share the work.

    DataError where a process is ended from outside.
    """
    if jobs == 1 or len(files) < 2:
        yield from (_tried(folder, file, said) for file in files)
        return
    asked = ((folder.path, file, said) for file in files)
    try:
        with ProcessPoolExecutor(min(jobs, len(files)), get_context("spawn")) as pool:
            yield from pool.map(_in_process, asked, chunksize=CHUNK)
    except BrokenProcessPool as error:
        told = f"{folder.path}: one of the {jobs} processes was ended from outside; nothing is stored"
        raise DataError(f"{told}; try again with fewer --jobs") from error


def remove_leftovers(folder: MachineFolder) -> None:
    """Take away tap files that were made ready and not stored; to be called under the lock."""
    for path in (folder.path / "taps").glob(".*.h5.ready"):
        path.unlink()


def reason_of(file: Path, error: Exception) -> str:
    """An error about a file, without its name."""
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    return str(error).removeprefix(f"{file}: ")


_folders: dict[Path, MachineFolder] = {}


def _in_process(asked: tuple[Path, Path, Description]) -> Prepared | str:
    path, file, said = asked
    if path not in _folders:
        _folders[path] = MachineFolder(path)
    return _tried(_folders[path], file, said)


def _tried(folder: MachineFolder, file: Path, said: Description) -> Prepared | str:
    try:
        return prepared(folder, file, said)
    except (DataError, OSError, ValueError) as error:
        return reason_of(file, error)


def _written(taps: Path, tap: TapTest) -> tuple[Path, bytes]:
    make_folder(taps)
    content, path = tap_content(tap), taps / f".{tap.id}.h5.ready"
    with path.open("xb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
    return path, content
