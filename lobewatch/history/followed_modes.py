"""The modes followed in the rows of a history, by series and direction."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence

from lobewatch.history.history import Row
from lobewatch.tool.order import Place
from lobewatch.tool.series import FollowedMode


class FollowedModes:
    """Modes of the rows that were shown, each row looked at once."""

    def __init__(self) -> None:
        """No row yet."""
        self._modes: dict[str, dict[str, list[FollowedMode]]] = {}
        self._numbers: dict[str, dict[str, list[int]]] = {}
        self._rows = 0

    def before(self, place: Place, rows: Sequence[Row]) -> dict[str, list[FollowedMode]]:
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

    def _add(self, number: int, row: Row) -> None:
        values = row.followed
        if math.isfinite(values[0]) and not row.questions:
            mode = FollowedMode(row.time, *values)
            self._modes.setdefault(row.series, {}).setdefault(row.direction, []).append(mode)
            self._numbers.setdefault(row.series, {}).setdefault(row.direction, []).append(number)
