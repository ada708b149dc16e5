"""Stored rows behind a change that hold all the same: those of tap tests that build on what they were built on.

What a tap test says follows from its own file, from the mode followed before it, and of the other direction from the
test that it takes that from. So after a tap test of long ago, or one that is taken out, only the few tests next to it
are analysed anew.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from typing import NamedTuple

from acquisition import Remark
from lobewatch.history.followed_modes import FollowedModes
from lobewatch.history.history import Row, Values
from lobewatch.history.row_bytes import encode_row
from lobewatch.machine import TapEntry
from lobewatch.tool.assembly import TOGETHER
from lobewatch.tool.order import Place, earlier_numbers, places
from lobewatch.tool.series import FollowedMode


def is_of(row: Row, place: Place) -> bool:
    """Whether a row was made of this tap test, with all that a person said of it, since the same baseline."""
    tap = place.entry
    ground_of_row = row.tap_id, row.baseline, row.series, row.accepted, row.by_hand
    return ground_of_row == (tap.id, place.baseline, place.series, frozenset(tap.accepted), str(tap.by_hand))


class _Ground(NamedTuple):
    """What a tap test builds on, but for its own file."""

    said: tuple[Remark, ...]
    """Remarks on its mounting."""
    last: Values | None
    """The mode followed before it."""
    other: str
    """Tap test that the other direction is taken from; empty without any."""
    cross: str
    """Cross tap that its axes are taken from; empty without any."""
    near: tuple[FollowedMode, ...]
    """Modes that it is moved by where it is that old."""


class _Archive:
    """Tap tests in an order, with their rows."""

    def __init__(self, ordered: Sequence[Place], rows: Sequence[Row]) -> None:
        self.places, self.rows = ordered, rows
        self._followed = FollowedModes()

    def ground(self, place: Place) -> _Ground:
        before = (self.rows[number] for number in earlier_numbers(place, self.places))
        last = next((row.followed for row in before if math.isfinite(row.followed[0]) and not row.questions), None)
        cross = "" if place.cross is None else self.places[place.cross].entry.id
        if place.across is None:
            return _Ground(place.remarks, last, "", cross, ())
        other = self.places[place.across].entry
        return _Ground(place.remarks, last, other.id, cross, self._near(place, datetime.fromisoformat(other.time)))

    def _near(self, place: Place, then: datetime) -> tuple[FollowedMode, ...]:
        if datetime.fromisoformat(place.entry.time) - then <= TOGETHER:
            return ()
        points = self._followed.before(place, self.rows)[place.entry.direction]
        behind = bisect_right(points, then, key=lambda point: point.time)
        return (*points[max(behind - 1, 0) : behind + 1], *points[-1:])


class StillHolding:
    """The stored rows of an archive as it was; what is said of them is asked in the order of time."""

    def __init__(self, rows: Sequence[Row], taps: Mapping[str, TapEntry], baselines: Sequence[datetime]) -> None:
        """rows: stored, of settings and version of now; taps: all of the journal; baselines: of now."""
        entries = [taps[row.tap_id] for row in rows if row.tap_id in taps]
        then = places(entries, baselines) if len(entries) == len(rows) else []
        known = then and all(
            (row.baseline, row.series) == (place.baseline, place.series) for row, place in zip(rows, then, strict=True)
        )
        self._then = _Archive(then, rows)
        self._numbers = {row.tap_id: number for number, row in enumerate(rows)} if known else {}
        self._alike: set[str] = set()
        self._now: _Archive | None = None

    def row(self, place: Place, ordered: Sequence[Place], rows: Sequence[Row]) -> Row | None:
        """The row of a tap test among these, if it holds; without the words on programs, which rest on all before it.

        rows: of the tap tests before it, of which `note` was told.
        """
        number = self._numbers.get(place.entry.id)
        if number is None:
            return None
        if self._now is None or self._now.rows is not rows:
            self._now = _Archive(ordered, rows)
        row, then = self._then.rows[number], self._then.places[number]
        if row.software or not is_of(row, place):
            return None
        ground = self._now.ground(place)
        if ground != self._then.ground(then) or (ground.other and not self._is_alike(ground.other, rows, place)):
            return None
        self._alike.add(row.tap_id)
        return replace(row, rulings=None)

    def note(self, row: Row) -> None:
        """A tap test was analysed anew, with this row."""
        number = self._numbers.get(row.tap_id)
        if number is not None and _content(row) == _content(self._then.rows[number]):
            self._alike.add(row.tap_id)

    def _is_alike(self, tap_id: str, rows: Sequence[Row], place: Place) -> bool:
        """Whether the row of an earlier tap test is as it was."""
        if tap_id in self._alike:
            return True
        number = self._numbers.get(tap_id)
        return number is not None and place.across is not None and rows[place.across] is self._then.rows[number]


def _content(row: Row) -> bytes:
    return encode_row(0, replace(row, rulings=None), {})
