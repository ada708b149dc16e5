"""Which measurements make up a tool in the spindle after a tap test: the newest of both directions, or a prediction."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Collection, Sequence

from acquisition import DataError
from lobewatch.history.history import Row
from lobewatch.machine import Machine, TapEntry
from lobewatch.measuring.measurement import Measurement
from lobewatch.measuring.questions.asked import open_questions
from lobewatch.tool.assembly import Assembly, assemble
from lobewatch.tool.order import Place
from lobewatch.tool.prediction import predict
from lobewatch.tool.series import FollowedMode
from modal import Mode

Measured = Callable[[Place], Measurement]


class NotTappedError(DataError):
    """A tool was neither tapped nor can it be predicted."""


def or_reason(work: Callable[[], Assembly]) -> Assembly | NotTappedError:
    """What some work gives, or why it is not known."""
    try:
        return work()
    except NotTappedError as error:
        return error


class FollowedModes:
    """The modes followed in the rows of a history, by series and direction, each row looked at once."""

    def __init__(self) -> None:
        """No row yet."""
        self._points: dict[str, dict[str, list[FollowedMode]]] = {}
        self._numbers: dict[str, dict[str, list[int]]] = {}
        self._rows = 0

    def before(self, place: Place, rows: Sequence[Row]) -> dict[str, list[FollowedMode]]:
        """Those of the same series before a tap test, by direction; rows: the history before it at least."""
        for number in range(self._rows, len(rows)):
            self._add(number, rows[number])
        self._rows = max(self._rows, len(rows))
        numbers = self._numbers.get(place.series, {})
        found = {
            direction: points[: bisect_left(numbers[direction], place.number)]
            for direction, points in self._points.get(place.series, {}).items()
        }
        return {"x": [], "y": [], **found}

    def _add(self, number: int, row: Row) -> None:
        values = row.followed
        if math.isfinite(values[0]) and not row.questions:
            self._points.setdefault(row.series, {}).setdefault(row.direction, []).append(
                FollowedMode(row.time, *values)
            )
            self._numbers.setdefault(row.series, {}).setdefault(row.direction, []).append(number)


def assemble_tapped(
    place: Place, places: Sequence[Place], points: dict[str, list[FollowedMode]], measured: Measured
) -> Assembly:
    """The assembly after a tap test; points: those before it of the same series, by direction."""
    newest, other = measured(place), None if place.other is None else measured(places[place.other])
    if newest.followed is not None and not open_questions(newest.remarks):
        points.setdefault(newest.direction, []).append(_point(newest, newest.followed))
    return assemble(newest, other, points)


def predict_untapped(
    machine: Machine, places: Sequence[Place], rows: Sequence[Row], measured: Measured, tool: str
) -> Assembly:
    """A tool that was not tapped in these places; NotTappedError where it cannot be predicted."""
    newest: dict[str, Measurement] = {}
    for place in reversed(places):
        row = rows[place.number]
        if row.bearing_stiffness.is_known and not row.questions and row.direction not in newest:
            newest[row.direction] = measured(place)
    try:
        return predict(machine, list(newest.values()), tool)
    except DataError as error:
        raise NotTappedError(f"no tap test with tool {tool!r}, and no prediction: {error}") from error


def first_like(
    now: Assembly, taps: Sequence[TapEntry], asked: Collection[str], assembly: Callable[[str, str], Assembly]
) -> Assembly | None:
    """The earliest of the same tool that knows the same directions; None where that is itself.

    asked: tap tests in question, which are no reference; assembly: of a tool after a tap test.
    """
    seen: set[str] = set()
    for tap in taps:
        if tap.id == now.tap_id:
            return None
        if tap.tool != now.tool or tap.id in asked:
            continue
        seen.add(tap.direction)
        if seen >= set(now.directions):
            then = assembly(tap.tool, tap.id)
            if then.directions == now.directions:
                return then
    return None


def _point(one: Measurement, mode: Mode) -> FollowedMode:
    return FollowedMode(one.time, mode.frequency, mode.damping_ratio, mode.stiffness, mode.phase_deg)
