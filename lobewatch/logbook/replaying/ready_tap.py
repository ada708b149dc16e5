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
from lobewatch.logbook.replaying.tap_draft import (
    FileRequest,
    TapDraft,
    draft_requested_tap,
    draft_tap,
    is_draft,
    reason_of,
)
from lobewatch.machine import MachineFolder, TapEntry
from lobewatch.measuring.measurement import TapFit
from lobewatch.measuring.workers.share_work import Workers, share_work


@dataclass(frozen=True, eq=False)
class ReadyTap:
    """One file."""

    digest: str
    """SHA-256 of the file."""
    temporary: Path
    """Path of its tap file under a temporary name."""
    entry: TapEntry
    """Journal entry of that."""
    created: datetime
    """Time of the recording."""
    fit: TapFit
    """The modes in it."""
    taken: tuple[str, ...]
    """Facts that were taken for granted where the file does not say them."""


def make_ready(folder: MachineFolder, file: Path, description: Description) -> ReadyTap:
    """One file; DataError, OSError or ValueError where it cannot be used."""
    return _write(folder, draft_tap(folder, file, description))


def make_all_ready(
    folder: MachineFolder, files: Sequence[Path], description: Description, workers: Workers
) -> Iterator[ReadyTap | str]:
    """Each file in turn, or why it cannot be used; DataError as `share_work`."""
    if not workers.are_elsewhere:
        yield from (_ready_or_reason(folder, file, description) for file in files)
        return
    toml = folder.toml_text
    asked = (FileRequest.of(file, description, toml) for file in files)
    for draft in share_work(draft_requested_tap, asked, workers, is_draft):
        yield draft if isinstance(draft, str) else _write(folder, draft)


def remove_leftovers(folder: MachineFolder) -> None:
    """Take away tap files that were made ready and not stored; to be called under the lock."""
    for path in (folder.path / "taps").glob(".*.h5.ready"):
        path.unlink()


def _ready_or_reason(folder: MachineFolder, file: Path, description: Description) -> ReadyTap | str:
    try:
        return make_ready(folder, file, description)
    except (DataError, OSError, ValueError) as error:
        return reason_of(file, error)


def _write(folder: MachineFolder, draft: TapDraft) -> ReadyTap:
    taps = folder.path / "taps"
    make_folder(taps)
    path = taps / f".{draft.entry.id}.h5.ready"
    with path.open("xb") as file:
        file.write(draft.content)
        file.flush()
        os.fsync(file.fileno())
    return ReadyTap(draft.digest, path, draft.entry, draft.created, draft.fit, draft.taken)
