"""Earlier tests of a series from the rows of the history, and the questions that they raise."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from acquisition import Remark
from lobewatch.history.history import HistoryRow
from lobewatch.measurement.series_questions import (
    MAX_DAY,
    NEW_LEVEL_CODES,
    EarlierTest,
    SeriesReference,
    check_same_direction,
    check_series,
)
from lobewatch.tool.tap_series import TapPlace, iterate_earlier


def find_reference(place: TapPlace, among: Sequence[TapPlace], rows: Sequence[HistoryRow]) -> SeriesReference:
    """Return the earlier tests of the series of a tap test, those in question not included."""
    own = find_earlier_tests([rows[number] for number in iterate_earlier(place, among)][::-1])
    if place.other_direction is None:
        return SeriesReference(own)
    other = among[place.other_direction]
    across, newest = [rows[number] for number in iterate_earlier(other, among)], rows[other.number]
    same_day = place.entry.created - other.entry.created <= MAX_DAY
    frequencies = tuple(mode[0] for mode in newest.modes) if same_day else ()
    return SeriesReference(own, find_earlier_tests([*reversed(across), newest]), frequencies)


def find_earlier_tests(rows: Sequence[HistoryRow]) -> tuple[EarlierTest, ...]:
    """Return the tests of rows in order of time that later tests are compared with."""
    known = [row for row in rows if row.frequency.is_known and not row.questions]
    return tuple(
        EarlierTest(row.time, row.frequency.value, row.stiffness.value, not NEW_LEVEL_CODES.isdisjoint(row.accepted))
        for row in known
    )


def find_series_questions(row: HistoryRow, reference: SeriesReference) -> tuple[Remark, ...]:
    """Return the questions that the followed mode of a row raises in its series."""
    if row.mode is None:
        return ()
    errors = [value.std for value in (row.frequency, row.damping_ratio, row.stiffness)]
    mode = replace(row.mode, covariance=np.diag(np.square(errors)))
    same = check_same_direction(mode, [mode], reference)
    return (*check_series(mode, reference), *(() if same is None else (same,)))
