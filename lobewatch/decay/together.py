"""Which tap tests of a series are one point: those of a day, but for one that the tests before it asked for.

Whether they did is what `calls_for_another` says of the points up to then. A long archive has thousands of days with
several tests, and each of them is a series of its own to be judged; so whole blocks of them are judged by sums that
they share, and one by one only where that comes out too close to tell.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from datetime import datetime, timedelta
from functools import lru_cache
from statistics import median
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, stdtrit

from lobewatch.decay.change_point import FIRST_JUDGED, SURE, calls_for_another
from lobewatch.decay.temperature import may_count

DAY = timedelta(hours=24)
"""Tap tests within so long are one point."""
BLOCK = 64
"""Series that are judged at once."""
AHEAD = 4 * BLOCK
"""Tests of days that have one already that are looked at before any of them is judged."""
KEPT = 32
"""Series that are remembered."""
CLOSE = 1e-6
"""Share of the threshold, nearer to which the sums do not tell: their rounding is a thousandth of it."""

Floats = NDArray[np.float64]
Counts = NDArray[np.intp]
Span = tuple[int, int]
"""First tap test of a point, and the one behind its last."""


class _Question(NamedTuple):
    """Whether a point and those before it have asked for one more test."""

    point: int
    """Its number."""
    tap: int
    """The test that comes then; those before it are all that the point has."""


class Series(NamedTuple):
    """Tap tests, oldest first."""

    times: Sequence[datetime]
    """When."""
    percents: Sequence[float]
    """Their values."""
    temperatures: Sequence[float]
    """Of the spindle; NaN where not recorded."""

    def goes_on(self, before: Series) -> bool:
        """Whether these are the tests of another series, and later ones."""
        return all(mine[: len(its)] == its for mine, its in zip(self, before, strict=True))

    def percent(self, span: Span) -> float:
        """Of a point: mean of two, median from three on."""
        first, end = span
        if end - first > 2:
            return median(self.percents[first:end])
        return (self.percents[first] + self.percents[end - 1]) / 2

    def temperature(self, span: Span) -> float:
        """Mean of those recorded; NaN where none was."""
        known = [one for one in self.temperatures[slice(*span)] if one == one]
        return sum(known) / len(known) if known else np.nan


def together(series: Series, most: int) -> list[Span]:
    """The points of a series; most: of the newest ones are judged together."""
    memory = _memory(most, tuple(series.times[:1]), tuple(series.percents[:3]))
    spans = next(([*known] for before, known in memory if series.goes_on(before)), [])
    while not spans or spans[-1][1] < len(series.times):
        asked = _joined(series.times, spans)
        called = next(_called(series, spans, asked, most), None)
        if called is not None:
            spans[called.point :] = [(spans[called.point][0], called.tap), (called.tap, called.tap + 1)]
    memory[:] = [(series, spans)]
    return [*spans]


@lru_cache(maxsize=KEPT)
def _memory(*_: object) -> list[tuple[Series, list[Span]]]:
    """The series that began like this, as it was told apart last: what comes later does not alter it."""
    return []


def _joined(times: Sequence[datetime], spans: list[Span]) -> list[_Question]:
    """Add tests behind these points as if no test asked for one more; what has to be asked whether one did."""
    asked = list[_Question]()
    first, end = spans.pop() if spans else (0, 1)
    while end < len(times) and len(asked) < AHEAD:
        if times[end] - times[first] < DAY:
            asked.append(_Question(len(spans), end))
        else:
            spans.append((first, end))
            first = end
        end += 1
    spans.append((first, end))
    return asked


def _called(series: Series, spans: Sequence[Span], asked: Sequence[_Question], most: int) -> Iterator[_Question]:
    """Those that are to be answered with yes."""
    if not asked:
        return
    if may_count(np.array(series.temperatures)):
        yield from (one for one in asked if _exactly(series, spans, one, most))
        return
    needed = max(asked[0].point - most, 0)
    points = np.array([0.0] * needed + [series.percent(span) for span in spans[needed:]])
    for begin in range(0, len(asked), BLOCK):
        block = [one for one in asked[begin : begin + BLOCK] if min(one.point + 1, most) >= FIRST_JUDGED]
        for one, answer in zip(block, _answers(series, spans, points, block, most), strict=True):
            if answer if answer is not None else _exactly(series, spans, one, most):
                yield one


def _exactly(series: Series, spans: Sequence[Span], one: _Question, most: int) -> bool:
    own = [*spans[max(one.point + 1 - most, 0) : one.point], (spans[one.point][0], one.tap)]
    y, warmth = ([of(span) for span in own] for of in (series.percent, series.temperature))
    return calls_for_another(np.array(y), np.array(warmth))


def _answers(
    series: Series, spans: Sequence[Span], points: Floats, asked: Sequence[_Question], most: int
) -> list[bool | None]:
    """Whether the last point is sure of a fall that the one before it was not; None where the sums do not tell."""
    if not asked:
        return []
    end = np.array([one.point for one in asked])
    n = np.minimum(end + 1, most)
    own = np.array([series.percent((spans[one.point][0], one.tap)) for one in asked])
    sure, not_sure = _told(points, end, n, own)
    open_ones = np.flatnonzero(~not_sure & (n > FIRST_JUDGED))
    before, not_before = np.zeros_like(sure), ~not_sure & (n == FIRST_JUDGED)
    if open_ones.size:
        last = end[open_ones] - 1
        before[open_ones], not_before[open_ones] = _told(points, last, n[open_ones] - 1, points[last])
    yes, no = sure & not_before, not_sure | before
    return [True if y else False if n else None for y, n in zip(yes.tolist(), no.tolist(), strict=True)]


def _told(points: Floats, end: Counts, n: Counts, own: Floats) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Whether series of n points (r,), the last `own` (r,) behind points up to `end` (r,), are sure of a fall, and
    whether they are surely not.

    As `watch` without a temperature: a change explains u^2 of the sum of squares Q, and is sure where its t =
    u sqrt((n - 2) / (Q - u^2)) is.
    """
    low = int((end - n + 1).min())
    y, own = points[low : end.max()] - points[low], own - points[low]
    sums, squares = (np.concatenate([[0.0], np.cumsum(one)]) for one in (y, y**2))
    doubled = np.cumsum(sums)
    end = end - low
    begin = end - n + 1
    total = sums[end] - sums[begin] + own
    left = squares[end] - squares[begin] + own**2 - total**2 / n
    weights = _weights_of(int(n[0])) if np.ptp(n) == 0 else _weights(n[:, np.newaxis])
    at = np.minimum(begin[:, np.newaxis] + weights.k, end[:, np.newaxis])
    mean, whole = (total / n)[:, np.newaxis], (sums[end] + own)[:, np.newaxis]
    step = (sums[at] - (sums[begin][:, np.newaxis] + weights.k * mean)) * weights.step
    behind = weights.triangle * mean - weights.behind * whole
    slope = (behind + (doubled[end][:, np.newaxis] - doubled[at])) * weights.slope
    most = np.maximum(step.max(axis=1), slope.max(axis=1))
    t = -stdtrit(n - 2, ndtr(-SURE))
    with np.errstate(invalid="ignore"):
        threshold = t * np.sqrt(left / (n - 2 + t**2))
    return most > threshold * (1 + CLOSE), most < threshold * (1 - CLOSE)


class _Weights(NamedTuple):
    """Of changes from each of the points k on, in series of n points; 0 where no change is looked for."""

    k: Counts
    """From 1 on."""
    behind: Floats
    """Points behind k."""
    triangle: Floats
    """Sum of a slope from k on."""
    step: Floats
    """1 over the root of the square of a step beside the mean."""
    slope: Floats
    """The same of a slope."""


def _weights(n: Counts) -> _Weights:
    """n: shape (r, 1)."""
    k = np.arange(1, n.max() - 1)
    behind = np.maximum(n - k, 1) - 1.0
    triangle = behind * (behind + 1) / 2
    step = (behind + 1) * k / n
    slope = triangle * (2 * behind + 1) / 3 - triangle**2 / n
    allowed = (k >= 2) & (k <= n - 2), k <= n - 3
    roots = (
        np.where(yes, 1 / np.sqrt(np.where(yes, one, 1.0)), 0.0)
        for yes, one in zip(allowed, (step, slope), strict=True)
    )
    return _Weights(k, behind, triangle, *roots)


@lru_cache(maxsize=4)
def _weights_of(n: int) -> _Weights:
    return _weights(np.array([[n]]))
