"""The watch over a series for a fall: the change-point model, judged anew at each point.

Hawkins, Qiu & Kang (2003), "The changepoint model for statistical process control", Journal of Quality
Technology 35(4), with hinges beside the steps, one-sided.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple, Self

import numpy as np
import scipy
from numpy.typing import NDArray

from lobewatch.decay.readings import Readings
from lobewatch.decay.series_base import SeriesBase, base_of

FIRST_JUDGED = 9
"""Number of points before which nothing is judged; chosen."""
FIRST_OF_KNOWN = 5
"""The same where something is known of the scatter beforehand; chosen."""
SURE = 3.3
"""Score from which a change is taken for real: a chance of 1 in 2000 where only the last point is looked at."""
ALIKE = 0.5
"""Least share of what two series did on the mean that one of them did, where that counts for it; chosen."""
ROWS = 64
"""Number of points that are judged at once, to bound the memory."""

Floats = NDArray[np.float64]
Kind = Literal["step", "slope"]
KINDS: tuple[Kind, ...] = ("step", "slope")
LEFT = ((2, 2), (1, 3))
"""Least number of points before a change of each kind, and from it on."""


class Fall(NamedTuple):
    """A change of a series, as it is fitted to a number of its points."""

    kind: Kind
    """Kind: fallen at once, or falling since."""
    point: int
    """Index of the first point after the step, or of the last one before the slope."""
    size: float
    """Fall from there to the last point fitted, in the unit of the series."""
    half_width: float
    """Half the width of the 95 % interval of the size."""


class LikeliestChange(NamedTuple):
    """The likeliest change in the points up to each of some of them."""

    score: Floats
    """Score: how ill a steady series fits, as a quantile of the normal distribution, shape (r,)."""
    fell: NDArray[np.bool_]
    """Whether the change is a step, shape (r,)."""
    point: NDArray[np.intp]
    """Index of its point as in Fall, shape (r,)."""

    @classmethod
    def of_none(cls, n: int) -> Self:
        """Where no point is judged."""
        return cls(np.full(n, np.nan), np.zeros(n, np.bool_), np.zeros(n, np.intp))


@dataclass(frozen=True, eq=False)
class Watch:
    """Judgement on the points of a series, one after the other."""

    base: SeriesBase
    """Base of the fits."""
    change: LikeliestChange
    """Likeliest change up to each point; the score of the first ones, which are not judged, is NaN."""
    sign: int
    """1 where it looks for falls, -1 where for rises."""

    @property
    def scores(self) -> Floats:
        """Score of each point: how ill a steady series fits up to it, as a quantile of the normal distribution, shape
        (n,); NaN before the 9th, before the 5th where something is known of the scatter beforehand."""
        return self.change.score

    @cached_property
    def sure(self) -> NDArray[np.bool_]:
        """Whether each point is sure of a change, shape (n,)."""
        with np.errstate(invalid="ignore"):
            return np.asarray(self.scores >= SURE)

    @property
    def alarm_at(self) -> int | None:
        """Index of the first point that is sure of a change as the one before it was; None where there is none."""
        return next(self.alarms_from(0), None)

    def alarms_from(self, first: int) -> Iterator[int]:
        """Points from one on that are sure of a change as the ones before them were."""
        begin = max(first, 1)
        return (begin + int(i) for i in np.flatnonzero(self.sure[begin:] & self.sure[begin - 1 : -1]))

    def fall_at(self, alarm: int) -> Fall:
        """The change that a point is sure of: kind and beginning as it sees them, size by all points."""
        return _fall(self.base, self.change, alarm, self.sign)


def newest_change(y: Floats) -> Fall | None:
    """The fall, or with a negative size the rise, that the last two points (n,) are both sure of; None without one."""
    if y.size <= FIRST_JUDGED:
        return None
    base = base_of(Readings(y))
    for sign, change in zip((1, -1), _likeliest_changes(base, np.arange(y.size - 2, y.size)), strict=True):
        if (change.score >= SURE).all():
            fall = _fall(base, change, -1, sign)
            return fall._replace(size=sign * fall.size)
    return None


def watch(readings: Readings) -> Watch:
    """Judge a series point after point: whether it falls."""
    return watch_both(readings)[0]


def watch_both(readings: Readings) -> tuple[Watch, Watch]:
    """Judge a series likewise, and its mirror image: whether it rises.

    What the mean of both directions did is looked at beside what the one did alone.
    """
    base, common, shared = base_of(readings), base_of(readings.common), readings.shared
    pairs = zip(_judge_points(base), _judge_points(common), strict=True)
    falls, rises = (_surer(base, alone, common, together, shared) for alone, together in pairs)
    return Watch(base, falls, 1), Watch(base, rises, -1)


def _judge_points(base: SeriesBase) -> tuple[LikeliestChange, LikeliestChange]:
    """The likeliest fall, and the likeliest rise, up to each point."""
    first = FIRST_OF_KNOWN if base.scatter.freedom else FIRST_JUDGED
    last = np.arange(first - 1, base.y.size)
    falls, rises = (LikeliestChange.of_none(base.y.size) for _ in range(2))
    if last.size:
        for every, judged in zip((falls, rises), _likeliest_changes(base, last), strict=True):
            for values, part in zip(every, judged, strict=True):
                values[last] = part
    return falls, rises


def _surer(
    base: SeriesBase,
    alone: LikeliestChange,
    common: SeriesBase,
    together: LikeliestChange,
    shared: NDArray[np.intp],
) -> LikeliestChange:
    """The surer of what a series did alone and what the mean of both directions did, where the series did that too.

    shared: points of the series that the mean has. Who looks twice is told of chance twice as often.
    """
    n = np.flatnonzero(np.isfinite(together.score)) + 1
    last, fell, middle = shared[n - 1], together.fell[n - 1], together.point[n - 1]
    own, mean = base.size_of(fell, last + 1, shared[middle]), common.size_of(fell, n, middle)
    shares = own * mean >= ALIKE * mean**2
    counts = shares & ~(together.score[n - 1] <= alone.score[last])
    merged = LikeliestChange(alone.score.copy(), alone.fell.copy(), alone.point.copy())
    for values, part in zip(merged, (together.score[n - 1], fell, shared[middle]), strict=True):
        values[last[counts]] = part[counts]
    merged.score[last] = -scipy.special.ndtri(np.minimum(2 * scipy.special.ndtr(-merged.score[last]), 1.0))
    return merged


def _likeliest_changes(base: SeriesBase, last: NDArray[np.intp]) -> tuple[LikeliestChange, LikeliestChange]:
    """The likeliest fall, and the likeliest rise, in the points up to each of these, which follow one another."""
    blocks = [_farthest(base, last[begin : begin + ROWS] + 1) for begin in range(0, last.size, ROWS)]
    points, leans = (np.concatenate(parts, axis=2) for parts in zip(*blocks, strict=True))
    fall, rise = (_likeliest(base, last + 1, points[i], sign * leans[i]) for i, sign in enumerate((-1, 1)))
    return fall, rise


def _farthest(base: SeriesBase, n: NDArray[np.intp]) -> tuple[NDArray[np.intp], Floats]:
    """Where a change of each kind explains most in the first n (r,), and how much; shape (2, 2, r): falls, rises."""
    k, rows = np.arange(n[-1]), np.arange(n.size)
    points, leans = np.empty((2, len(KINDS), n.size), np.intp), np.empty((2, len(KINDS), n.size))
    for kind, (before, behind) in enumerate(LEFT):
        lean = base.lean(KINDS[kind], n[:, np.newaxis], k)
        outside = k[n[0] - behind :] > n[:, np.newaxis] - behind
        for side, (worst, farthest) in enumerate(((np.inf, np.argmin), (-np.inf, np.argmax))):
            np.copyto(lean[:, n[0] - behind :], worst, where=outside)
            lean[:, :before] = worst
            points[side, kind] = farthest(lean, axis=1)
            leans[side, kind] = lean[rows, points[side, kind]]
    return points, leans


def _likeliest(base: SeriesBase, n: NDArray[np.intp], points: NDArray[np.intp], leans: Floats) -> LikeliestChange:
    """The likelier of two changes in the first n (r,), one of each kind at a point (2, r), that explain so much."""
    t = [base.t_of(lean, n) for lean in leans]
    scores = -scipy.special.ndtri(scipy.special.stdtr(base.freedom(n), -np.maximum(*t)))
    fell = t[0] >= t[1]
    return LikeliestChange(scores, fell, np.where(fell, points[0], points[1]))


def _fall(base: SeriesBase, change: LikeliestChange, at: int, sign: int) -> Fall:
    """The change up to one of the points, fitted to the whole series; at: index of that point."""
    kind: Kind = "step" if change.fell[at] else "slope"
    n, point = base.y.size, int(change.point[at])
    beta, error = base.fit_change(kind, n, point)
    length = n - 1 - point if kind == "slope" else 1
    student = float(scipy.special.stdtrit(base.freedom(np.array([n]))[0], 0.975))
    return Fall(kind, point, -sign * beta * length, error * length * student)
