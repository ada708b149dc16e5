"""Earlier tests of a series from the rows of the history, and the questions that they raise."""

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from acquisition import Remark
from lobewatch.history.history import HistoryRow
from lobewatch.measurement.series_modes import find_series_questions
from lobewatch.measurement.series_questions import (
    MAX_DAY,
    NEW_LEVEL_CODES,
    EarlierTest,
    SeriesReference,
)
from lobewatch.tool.tap_series import TapPlace
from modal import Mode


class EarlierTestIndex:
    """Index of the earlier tests of each series and direction, each row read once."""

    def __init__(self) -> None:
        self._tests: dict[tuple[str, str], list[EarlierTest]] = {}
        self._numbers: dict[tuple[str, str], list[int]] = {}
        self._rows = 0

    def find_reference(self, place: TapPlace, among: Sequence[TapPlace], rows: Sequence[HistoryRow]) -> SeriesReference:
        """Return the earlier tests of the series of a tap test, those in question not included.

        rows: at least the history before it, and the same as before.
        """
        for number, row in enumerate(rows[self._rows :], self._rows):
            for test in find_earlier_tests([row]):
                self._tests.setdefault((row.series, row.direction), []).append(test)
                self._numbers.setdefault((row.series, row.direction), []).append(number)
        self._rows = max(self._rows, len(rows))
        own = self._before(place.number, place.series, place.entry.direction)
        if place.other_direction is None:
            return SeriesReference(own)
        other = among[place.other_direction]
        same_day = place.entry.created - other.entry.created <= MAX_DAY
        frequencies = tuple(mode[0] for mode in rows[other.number].modes) if same_day else ()
        return SeriesReference(own, self._before(place.number, place.series, other.entry.direction), frequencies)

    def _before(self, number: int, series: str, direction: str) -> tuple[EarlierTest, ...]:
        """Return the tests of one direction of a series before a number."""
        key = series, direction
        return tuple(self._tests.get(key, [])[: bisect_left(self._numbers.get(key, []), number)])


def find_earlier_tests(rows: Sequence[HistoryRow]) -> tuple[EarlierTest, ...]:
    """Return the tests of rows in order of time that later tests are compared with."""
    known = [row for row in rows if row.frequency.is_known and not row.questions]
    return tuple(
        EarlierTest(
            row.time,
            row.frequency.value,
            row.stiffness.value,
            not NEW_LEVEL_CODES.isdisjoint(row.accepted),
            row.modes,
        )
        for row in known
    )


def find_row_questions(row: HistoryRow, reference: SeriesReference) -> tuple[Remark, ...]:
    """Return the questions that the modes of a row raise in its series."""
    if row.mode is None:
        return ()
    errors = [value.std for value in (row.frequency, row.damping_ratio, row.stiffness)]
    followed = replace(row.mode, covariance=np.diag(np.square(errors)))
    others = [Mode(*values[:3], phase_deg=values[3]) for values in row.modes if values[2] > 0]
    return find_series_questions(followed, [followed, *(mode for mode in others if mode != row.mode)], reference)
