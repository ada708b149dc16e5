"""history.h5: what it still holds, and its place on the disk."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime
from itertools import takewhile

from acquisition import Remark
from lobes import read_history, write_history
from lobewatch.analysis.columns.history_columns import from_columns, to_columns
from lobewatch.analysis.history import History, Row, empty_history
from lobewatch.analysis.order import Place
from lobewatch.analysis.questions.asked import accepted_codes
from lobewatch.machine import BusyError, MachineFolder


def stored_history(folder: MachineFolder, places: Sequence[Place], baseline: datetime | None) -> History:
    """The stored rows of the oldest taps on, as far as they were made with these settings and this version.

    baseline: the newest one.
    """
    empty = replace(empty_history(folder.machine), baseline=baseline)
    try:
        stored = read_history(folder.history)
        if (stored.settings_hash, stored.software) != (empty.settings_hash, empty.software):
            return empty
        rows = from_columns(stored, folder.machine).rows
    except (ValueError, KeyError, IndexError, FileNotFoundError):
        return empty
    pairs = zip(rows, places, strict=False)
    return replace(empty, rows=tuple(row for row, _ in takewhile(lambda pair: _is_of(*pair), pairs)))


def _is_of(row: Row, place: Place) -> bool:
    """Whether a row was made of this tap test, with all that was accepted of it, since the same baseline."""
    tap = place.entry
    made = row.tap_id, row.baseline, row.series, accepted_codes(row.remarks)
    return made == (tap.id, place.baseline, place.series, set(tap.accepted))


def store_history(folder: MachineFolder, history: History) -> list[Remark]:
    """Write it under the lock where that can be had at once; else say so."""
    try:
        with folder.locked():
            write_history(folder.history, to_columns(history, folder.machine))
    except (BusyError, OSError) as error:
        text = f"not brought up to date on the disk, worked out in memory: {error}"
        return [Remark("history-in-memory", "history.h5", text)]
    return []
