"""Find stored history rows that stay valid after a change.

A result depends on its own file, on the followed mode before it, and in the other direction on the test that it is
taken from. So after an old tap test is added or excluded, only its neighbours are analysed again.
"""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime

from acquisition import Remark
from lobewatch.history.history import HistoryRow, ModeValues
from lobewatch.history.row_codec import encode_row
from lobewatch.machine import TapEntry
from lobewatch.tool.assembly import MAX_DIRECTION_AGE
from lobewatch.tool.tap_series import FollowedMode, TapOrder, TapPlace, iterate_earlier


class FollowedModeIndex:
    """Index of the followed modes of rows, each row read once."""

    def __init__(self) -> None:
        self._modes: dict[str, dict[str, list[FollowedMode]]] = {}
        self._numbers: dict[str, dict[str, list[int]]] = {}
        self._rows = 0

    def before(self, place: TapPlace, rows: Sequence[HistoryRow]) -> dict[str, list[FollowedMode]]:
        """Return the earlier modes of the series of a tap test by direction; rows: at least the history before it."""
        for number, row in enumerate(rows[self._rows :], self._rows):
            if math.isfinite(row.frequency.value) and not row.questions:
                mode = FollowedMode(row.time, *row.followed)
                self._modes.setdefault(row.series, {}).setdefault(row.direction, []).append(mode)
                self._numbers.setdefault(row.series, {}).setdefault(row.direction, []).append(number)
        self._rows = max(self._rows, len(rows))
        numbers = self._numbers.get(place.series, {})
        earlier = {
            direction: modes[: bisect_left(numbers[direction], place.number)]
            for direction, modes in self._modes.get(place.series, {}).items()
        }
        return {"x": [], "y": [], **earlier}


def is_row_of(row: HistoryRow, place: TapPlace) -> bool:
    """Tell whether a row is of this tap test with the same baseline, answers and mode edits."""
    tap = place.entry
    ground_of_row = row.tap_id, row.baseline, row.series, row.accepted, row.by_hand
    return ground_of_row == (tap.id, place.baseline, place.series, frozenset(tap.accepted), str(tap.by_hand))


_RowBasis = tuple[str, str, ModeValues | None, tuple[Remark, ...], tuple[FollowedMode, ...]]
"""Inputs of a result besides its own file: tap test of the other direction and cross FRF (empty without one), followed
mode before it, remarks on its mounting, and modes that shift an older direction."""


class _RowArchive:
    """Ordered tap tests with their rows."""

    def __init__(self, ordered: Sequence[TapPlace], rows: Sequence[HistoryRow]) -> None:
        self.places, self.rows = ordered, rows
        self._followed = FollowedModeIndex()

    def basis_of(self, place: TapPlace) -> _RowBasis:
        before = (self.rows[number] for number in iterate_earlier(place, self.places))
        last = next((row.followed for row in before if math.isfinite(row.followed[0]) and not row.questions), None)
        cross = "" if place.cross is None else self.places[place.cross].entry.id
        if place.other_direction is None:
            return "", cross, last, place.remarks, ()
        other = self.places[place.other_direction].entry
        if place.entry.created - other.created <= MAX_DIRECTION_AGE:
            return other.id, cross, last, place.remarks, ()
        points = self._followed.before(place, self.rows)[place.entry.direction]
        behind = bisect_right(points, other.created, key=lambda point: point.time)
        near = (*points[max(behind - 1, 0) : behind + 1], *points[-1:])
        return other.id, cross, last, place.remarks, near


class ReusableRows:
    """Stored rows of a former order, queried in order of time."""

    def __init__(self, rows: Sequence[HistoryRow], taps: Mapping[str, TapEntry], baselines: Sequence[datetime]) -> None:
        entries = [taps[row.tap_id] for row in rows if row.tap_id in taps]
        then = TapOrder(baselines, entries).places if len(entries) == len(rows) else []
        pairs = zip(rows, then, strict=True) if then else ()
        known = then and all((row.baseline, row.series) == (place.baseline, place.series) for row, place in pairs)
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
        basis = self._now.basis_of(place)
        if basis != self._then.basis_of(then) or (basis[0] and not self._is_alike(basis[0], rows, place)):
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
        number, other = self._numbers.get(tap_id), place.other_direction
        return number is not None and other is not None and rows[other] is self._then.rows[number]


def _encode_content(row: HistoryRow) -> bytes:
    return encode_row(0, replace(row, verdicts=None), {})
