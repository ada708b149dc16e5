"""Find stored history rows that stay valid after a change.

A result depends on its own file, on the followed mode before it, and in the other direction on the test that it is
taken from. So after an old tap test is added or excluded, only its neighbours are analysed again.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from typing import NamedTuple

from acquisition import Remark
from lobewatch.history.history import HistoryRow, ModeValues
from lobewatch.history.row_codec import encode_row
from lobewatch.machine import TapEntry
from lobewatch.tool.assembly import MAX_DIRECTION_AGE
from lobewatch.tool.tap_series import FollowedMode, TapPlace, iterate_earlier, order_taps


class FollowedModeIndex:
    """Index of the followed modes of rows, each row read once."""

    def __init__(self) -> None:
        self._modes: dict[str, dict[str, list[FollowedMode]]] = {}
        self._numbers: dict[str, dict[str, list[int]]] = {}
        self._rows = 0

    def before(self, place: TapPlace, rows: Sequence[HistoryRow]) -> dict[str, list[FollowedMode]]:
        """Return the earlier modes of the series of a tap test by direction; rows: at least the history before it."""
        for number in range(self._rows, len(rows)):
            self._add(number, rows[number])
        self._rows = max(self._rows, len(rows))
        numbers = self._numbers.get(place.series, {})
        earlier = {
            direction: modes[: bisect_left(numbers[direction], place.number)]
            for direction, modes in self._modes.get(place.series, {}).items()
        }
        return {"x": [], "y": [], **earlier}

    def _add(self, number: int, row: HistoryRow) -> None:
        values = row.followed
        if math.isfinite(values[0]) and not row.questions:
            mode = FollowedMode(row.time, *values)
            self._modes.setdefault(row.series, {}).setdefault(row.direction, []).append(mode)
            self._numbers.setdefault(row.series, {}).setdefault(row.direction, []).append(number)


def is_row_of(row: HistoryRow, place: TapPlace) -> bool:
    """Tell whether a row is of this tap test with the same baseline, answers and mode edits."""
    tap = place.entry
    ground_of_row = row.tap_id, row.baseline, row.series, row.accepted, row.by_hand
    return ground_of_row == (tap.id, place.baseline, place.series, frozenset(tap.accepted), str(tap.by_hand))


class _RowBasis(NamedTuple):
    """Inputs of a result besides its own file."""

    mounting_remarks: tuple[Remark, ...]
    """Remarks on its mounting."""
    previous_mode: ModeValues | None
    """Followed mode before it."""
    other_tap: str
    """Tap test of the other direction; empty without one."""
    cross_tap: str
    """Cross FRF of its principal directions; empty without one."""
    nearby_modes: tuple[FollowedMode, ...]
    """Modes that shift an older direction."""


class _RowArchive:
    """Ordered tap tests with their rows."""

    def __init__(self, ordered: Sequence[TapPlace], rows: Sequence[HistoryRow]) -> None:
        self.places, self.rows = ordered, rows
        self._followed = FollowedModeIndex()

    def ground(self, place: TapPlace) -> _RowBasis:
        before = (self.rows[number] for number in iterate_earlier(place, self.places))
        last = next((row.followed for row in before if math.isfinite(row.followed[0]) and not row.questions), None)
        cross = "" if place.cross is None else self.places[place.cross].entry.id
        if place.other_direction is None:
            return _RowBasis(place.remarks, last, "", cross, ())
        other = self.places[place.other_direction].entry
        return _RowBasis(place.remarks, last, other.id, cross, self._near(place, datetime.fromisoformat(other.time)))

    def _near(self, place: TapPlace, then: datetime) -> tuple[FollowedMode, ...]:
        if datetime.fromisoformat(place.entry.time) - then <= MAX_DIRECTION_AGE:
            return ()
        points = self._followed.before(place, self.rows)[place.entry.direction]
        behind = bisect_right(points, then, key=lambda point: point.time)
        return (*points[max(behind - 1, 0) : behind + 1], *points[-1:])


class ReusableRows:
    """Stored rows of a former order, queried in order of time."""

    def __init__(self, rows: Sequence[HistoryRow], taps: Mapping[str, TapEntry], baselines: Sequence[datetime]) -> None:
        entries = [taps[row.tap_id] for row in rows if row.tap_id in taps]
        then = order_taps(entries, baselines) if len(entries) == len(rows) else []
        known = then and all(
            (row.baseline, row.series) == (place.baseline, place.series) for row, place in zip(rows, then, strict=True)
        )
        self._then = _RowArchive(then, rows)
        self._numbers = {row.tap_id: number for number, row in enumerate(rows)} if known else {}
        self._alike: set[str] = set()
        self._now: _RowArchive | None = None

    def find(self, place: TapPlace, ordered: Sequence[TapPlace], rows: Sequence[HistoryRow]) -> HistoryRow | None:
        """Return the row of a tap test if it stays valid, without verdicts, which depend on all rows before it.

        rows: of the tap tests before it, all passed to `note` if new.
        """
        number = self._numbers.get(place.entry.id)
        if number is None:
            return None
        if self._now is None or self._now.rows is not rows:
            self._now = _RowArchive(ordered, rows)
        row, then = self._then.rows[number], self._then.places[number]
        if row.software or not is_row_of(row, place):
            return None
        ground = self._now.ground(place)
        if ground != self._then.ground(then) or (
            ground.other_tap and not self._is_alike(ground.other_tap, rows, place)
        ):
            return None
        self._alike.add(row.tap_id)
        return replace(row, verdicts=None)

    def note(self, row: HistoryRow) -> None:
        """Note the row of a tap test that was analysed again."""
        number = self._numbers.get(row.tap_id)
        if number is not None and _encode_content(row) == _encode_content(self._then.rows[number]):
            self._alike.add(row.tap_id)

    def _is_alike(self, tap_id: str, rows: Sequence[HistoryRow], place: TapPlace) -> bool:
        """Tell whether the row of an earlier tap test is unchanged."""
        if tap_id in self._alike:
            return True
        number = self._numbers.get(tap_id)
        return (
            number is not None
            and place.other_direction is not None
            and rows[place.other_direction] is self._then.rows[number]
        )


def _encode_content(row: HistoryRow) -> bytes:
    return encode_row(0, replace(row, verdicts=None), {})
