"""The points of a series: the tap tests of a day are one, but for one that the tests before it asked for.

Whether they did is what `calls_for_another` says of the points up to then. A long archive has thousands of days with
several tests, and each of them is a series of its own to be judged; so whole blocks of them are judged by sums that
they share, and one by one only where that comes out too close to tell.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterator, Sequence
from datetime import datetime, timedelta
from statistics import median
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, stdtrit

from lobewatch.decay.change_point import FIRST_JUDGED, SURE, calls_for_another
from lobewatch.decay.temperature import may_count

DAY = timedelta(hours=24)
"""Time within which tap tests are one point; chosen."""
BLOCK = 64
"""Series that are judged at once, to bound the memory."""
AHEAD = 4 * BLOCK
"""Tests of days that have one already that are looked at before any of them is judged."""
DIVISIONS_KEPT = 32
"""Number of series whose points are kept for when they go on: those of four machines with two directions."""
CLOSE = 1e-6
"""Share of the threshold, nearer to which the sums do not tell: their rounding is a thousandth of it."""

Floats = NDArray[np.float64]
Counts = NDArray[np.intp]
Span = tuple[int, int]
"""First tap test of a point, and the one behind its last."""


class _Retest(NamedTuple):
    """A tap test on a day that has one already: the first of a new point if it was asked for, else of that point."""

    point: int
    """Number of the point of that day."""
    tap: int
    """Number of the test; those before it are all that the point has."""


class PercentSeries(NamedTuple):
    """Tap tests with one of their values, oldest first."""

    times: tuple[datetime, ...]
    """Times of the tests."""
    percents: tuple[float, ...]
    """Changes of the value since the first test (%)."""
    temperatures: tuple[float, ...]
    """Temperatures of the spindle (degC); NaN where not recorded."""

    def goes_on(self, before: PercentSeries) -> bool:
        """Whether these are the tests of another series, and later ones."""
        return all(column[: len(start)] == start for column, start in zip(self, before, strict=True))

    def percent(self, span: Span) -> float:
        """Change of a point (%): mean of two, median from three on."""
        first, end = span
        if end - first > 2:
            return median(self.percents[first:end])
        return (self.percents[first] + self.percents[end - 1]) / 2

    def temperature(self, span: Span) -> float:
        """Mean of the temperatures recorded for a point; NaN where none was."""
        recorded = [temperature for temperature in self.temperatures[slice(*span)] if temperature == temperature]
        return sum(recorded) / len(recorded) if recorded else np.nan


class _Division(NamedTuple):
    """A series as it was divided into points."""

    series: PercentSeries
    """Tests that were divided."""
    spans: tuple[Span, ...]
    """Points of these tests."""


DIVISIONS: OrderedDict[tuple[object, ...], _Division] = OrderedDict()
"""Series divided last, the newest at the end, for a server whose machines are tapped: later tests do not alter earlier
points, so a series that goes on is divided from there on. Key: how many points are judged together, time of the first
test, its first three percents. Ended by the next series with that key, and by `DIVISIONS_KEPT` others."""


def divide_into_points(series: PercentSeries, most: int) -> tuple[Span, ...]:
    """The points of a series; most: of the newest ones are judged together."""
    key = most, series.times[:1], series.percents[:3]
    division = DIVISIONS.pop(key, None)
    spans = [*division.spans] if division is not None and series.goes_on(division.series) else []
    while not spans or spans[-1][1] < len(series.times):
        retests = _join_days(series.times, spans)
        retest = next(_asked_for(series, spans, retests, most), None)
        if retest is not None:
            spans[retest.point :] = [(spans[retest.point][0], retest.tap), (retest.tap, retest.tap + 1)]
    DIVISIONS[key] = division = _Division(series, tuple(spans))
    while len(DIVISIONS) > DIVISIONS_KEPT:
        DIVISIONS.popitem(last=False)
    return division.spans


def _join_days(times: Sequence[datetime], spans: list[Span]) -> list[_Retest]:
    """Add tests behind these points as if none was asked for; the tests of which that is still to be looked at."""
    retests = list[_Retest]()
    first, end = spans.pop() if spans else (0, 1)
    while end < len(times) and len(retests) < AHEAD:
        if times[end] - times[first] < DAY:
            retests.append(_Retest(len(spans), end))
        else:
            spans.append((first, end))
            first = end
        end += 1
    spans.append((first, end))
    return retests


def _asked_for(
    series: PercentSeries, spans: Sequence[Span], retests: Sequence[_Retest], most: int
) -> Iterator[_Retest]:
    """The tests that the points before them asked for."""
    if not retests:
        return
    if may_count(np.array(series.temperatures)):
        yield from (retest for retest in retests if _is_asked_for(series, spans, retest, most))
        return
    needed = max(retests[0].point - most, 0)
    points = np.array([0.0] * needed + [series.percent(span) for span in spans[needed:]])
    for begin in range(0, len(retests), BLOCK):
        block = [retest for retest in retests[begin : begin + BLOCK] if min(retest.point + 1, most) >= FIRST_JUDGED]
        for retest, answer in zip(block, _answer_by_sums(series, spans, points, block, most), strict=True):
            if answer if answer is not None else _is_asked_for(series, spans, retest, most):
                yield retest


def _is_asked_for(series: PercentSeries, spans: Sequence[Span], retest: _Retest, most: int) -> bool:
    """Whether the points before a test asked for it, by the watch itself."""
    points = [*spans[max(retest.point + 1 - most, 0) : retest.point], (spans[retest.point][0], retest.tap)]
    y, temperatures = ([of(span) for span in points] for of in (series.percent, series.temperature))
    return calls_for_another(np.array(y), np.array(temperatures))


def _answer_by_sums(
    series: PercentSeries, spans: Sequence[Span], points: Floats, retests: Sequence[_Retest], most: int
) -> list[bool | None]:
    """Whether the last point is sure of a fall that the one before it was not; None where the sums do not tell."""
    if not retests:
        return []
    end = np.array([retest.point for retest in retests])
    n = np.minimum(end + 1, most)
    newest = np.array([series.percent((spans[retest.point][0], retest.tap)) for retest in retests])
    sure, not_sure = _sure_of_fall(points, end, n, newest)
    undecided = np.flatnonzero(~not_sure & (n > FIRST_JUDGED))
    before, not_before = np.zeros_like(sure), ~not_sure & (n == FIRST_JUDGED)
    if undecided.size:
        last = end[undecided] - 1
        before[undecided], not_before[undecided] = _sure_of_fall(points, last, n[undecided] - 1, points[last])
    yes, no = sure & not_before, not_sure | before
    return [True if y else False if n else None for y, n in zip(yes.tolist(), no.tolist(), strict=True)]


def _sure_of_fall(
    points: Floats, end: Counts, n: Counts, newest: Floats
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Whether series of n points (r,), the last `newest` (r,) behind points up to `end` (r,), are sure of a fall, and
    whether they are surely not.

    As `watch` without a temperature: a change explains u^2 of the sum of squares Q, and is sure where its t =
    u sqrt((n - 2) / (Q - u^2)) is.
    """
    low = int((end - n + 1).min())
    y, newest = points[low : end.max()] - points[low], newest - points[low]
    sums, squares = (np.concatenate([[0.0], np.cumsum(power)]) for power in (y, y**2))
    doubled = np.cumsum(sums)
    end = end - low
    begin = end - n + 1
    total = sums[end] - sums[begin] + newest
    left = squares[end] - squares[begin] + newest**2 - total**2 / n
    weights = _weights((n[:1] if np.ptp(n) == 0 else n)[:, np.newaxis])
    at = np.minimum(begin[:, np.newaxis] + weights.k, end[:, np.newaxis])
    mean, whole = (total / n)[:, np.newaxis], (sums[end] + newest)[:, np.newaxis]
    step = (sums[at] - (sums[begin][:, np.newaxis] + weights.k * mean)) * weights.step
    behind = weights.triangle * mean - weights.behind * whole
    slope = (behind + (doubled[end][:, np.newaxis] - doubled[at])) * weights.slope
    most = np.maximum(step.max(axis=1), slope.max(axis=1))
    t = -stdtrit(n - 2, ndtr(-SURE))
    with np.errstate(invalid="ignore"):
        threshold = t * np.sqrt(left / (n - 2 + t**2))
    return most > threshold * (1 + CLOSE), most < threshold * (1 - CLOSE)


class _Weights(NamedTuple):
    """Weights of changes from each of the points k on, in series of n points; 0 where no change is looked for."""

    k: Counts
    """Points that a change is looked for from, 1 and more, shape (m,)."""
    behind: Floats
    """Number of points behind k, shape (r, m)."""
    triangle: Floats
    """Sum of a slope from k on, shape (r, m)."""
    step: Floats
    """Weight of a step, 1 over the root of its sum of squares beside the mean, shape (r, m)."""
    slope: Floats
    """Weight of a slope likewise, shape (r, m)."""


def _weights(n: Counts) -> _Weights:
    """Weights in series of n points, shape (r, 1)."""
    k = np.arange(1, n.max() - 1)
    behind = np.maximum(n - k, 1) - 1.0
    triangle = behind * (behind + 1) / 2
    step = (behind + 1) * k / n
    slope = triangle * (2 * behind + 1) / 3 - triangle**2 / n
    allowed = (k >= 2) & (k <= n - 2), k <= n - 3
    roots = (
        np.where(counts, 1 / np.sqrt(np.where(counts, square, 1.0)), 0.0)
        for counts, square in zip(allowed, (step, slope), strict=True)
    )
    return _Weights(k, behind, triangle, *roots)
