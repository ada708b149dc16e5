"""Find stored history rows that stay valid after a change.

What a tap test says follows from its own file, from the mode followed before it, and of the other direction from the
test that it takes that from. So after a tap test of long ago, or one that is taken out, only the few tests next to it
are analysed anew.
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
    """Modes of the rows that were shown, each row looked at once."""

    def __init__(self) -> None:
        """No row yet."""
        self._modes: dict[str, dict[str, list[FollowedMode]]] = {}
        self._numbers: dict[str, dict[str, list[int]]] = {}
        self._rows = 0

    def before(self, place: TapPlace, rows: Sequence[HistoryRow]) -> dict[str, list[FollowedMode]]:
        """Modes of the same series before a tap test, by direction; rows: the history before it at least."""
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
    """Whether a row was made of this tap test, with all that a person said of it, since the same baseline."""
    tap = place.entry
    ground_of_row = row.tap_id, row.baseline, row.series, row.accepted, row.by_hand
    return ground_of_row == (tap.id, place.baseline, place.series, frozenset(tap.accepted), str(tap.by_hand))


class _RowBasis(NamedTuple):
    """What a tap test builds on, but for its own file."""

    mounting_remarks: tuple[Remark, ...]
    """Remarks on its mounting."""
    previous_mode: ModeValues | None
    """The mode followed before it."""
    other_tap: str
    """Tap test that the other direction is taken from; empty without any."""
    cross_tap: str
    """Cross tap that its axes are taken from; empty without any."""
    nearby_modes: tuple[FollowedMode, ...]
    """Modes that it is moved by where it is that old."""


class _RowArchive:
    """Tap tests in an order, with their rows."""

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
    """The stored rows of an archive as it was; what is said of them is asked in the order of time."""

    def __init__(self, rows: Sequence[HistoryRow], taps: Mapping[str, TapEntry], baselines: Sequence[datetime]) -> None:
        """rows: stored, of settings and version of now; taps: all of the journal; baselines: of now."""
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
        """The row of a tap test among these, if it holds; without the words on programs, which rest on all before it.

        rows: of the tap tests before it, of which `note` was told.
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
        """A tap test was analysed anew, with this row."""
        number = self._numbers.get(row.tap_id)
        if number is not None and _encode_content(row) == _encode_content(self._then.rows[number]):
            self._alike.add(row.tap_id)

    def _is_alike(self, tap_id: str, rows: Sequence[HistoryRow], place: TapPlace) -> bool:
        """Whether the row of an earlier tap test is as it was."""
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
