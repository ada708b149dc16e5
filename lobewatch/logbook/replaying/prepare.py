"""Recorded files made ready to be stored, each by itself: tap files under temporary names, and the modes in them.

Nothing of it depends on another file, so others can share the work; what they find is equal bit by bit.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from acquisition import DataError, Description
from acquisition.atomic import make_folder
from lobewatch.logbook.replaying.understand import Asked, TapDraft, reason_of, work_out, work_out_file
from lobewatch.machine import MachineFolder, TapEntry
from lobewatch.measuring.measurement import TapFit
from lobewatch.measuring.workers.share_work import (Workers, shared)


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
    fit: TapFit
    """The modes in it."""
    taken: tuple[str, ...]
    """What was taken for granted where the file does not say it."""


def prepared(folder: MachineFolder, file: Path, said: Description) -> Prepared:
    """One file; DataError, OSError or ValueError where it cannot be used."""
    return _on_disk(folder, work_out_file(folder, file, said))


def all_prepared(
    folder: MachineFolder, files: Sequence[Path], said: Description, workers: Workers
) -> Iterator[Prepared | str]:
    """Each file in turn, or why it cannot be used; DataError as `shared`."""
    if not workers.are_elsewhere:
        yield from (_tried(folder, file, said) for file in files)
        return
    toml = folder.toml.read_text("utf-8")
    asked = (Asked.of(file, said, toml) for file in files)
    for found in shared(work_out, asked, workers):
        yield found if isinstance(found, str) else _on_disk(folder, found)


def remove_leftovers(folder: MachineFolder) -> None:
    """Take away tap files that were made ready and not stored; to be called under the lock."""
    for path in (folder.path / "taps").glob(".*.h5.ready"):
        path.unlink()


def _tried(folder: MachineFolder, file: Path, said: Description) -> Prepared | str:
    try:
        return prepared(folder, file, said)
    except (DataError, OSError, ValueError) as error:
        return reason_of(file, error)


def _on_disk(folder: MachineFolder, found: TapDraft) -> Prepared:
    taps = folder.path / "taps"
    make_folder(taps)
    path = taps / f".{found.entry.id}.h5.ready"
    with path.open("xb") as file:
        file.write(found.content)
        file.flush()
        os.fsync(file.fileno())
    return Prepared(found.digest, path, found.entry, found.created, found.fit, found.taken)
