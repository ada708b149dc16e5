"""The watch over a series for a fall: the change-point model, judged anew at each point.

Hawkins, Qiu & Kang (2003), "The changepoint model for statistical process control", Journal of Quality
Technology 35(4), with hinges beside the steps, one-sided.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri, stdtr, stdtrit

from lobewatch.decay.temperature import SeriesBase, base_of

FIRST_JUDGED = 9
"""Number of points before which nothing is judged; chosen."""
SURE = 3.3
"""Score from which a change is taken for real: a chance of 1 in 2000 where only the last point is looked at."""
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


NOTHING = (LikeliestChange(np.empty(0), np.empty(0, np.bool_), np.empty(0, np.intp)),) * 2
"""Falls and rises where no point is judged."""


@dataclass(frozen=True, eq=False)
class Watch:
    """Judgement on the points of a series, one after the other."""

    scores: Floats
    """Score of each point: how ill a steady series fits up to it, as a quantile of the normal distribution, shape (n,);
    NaN before the 9th."""
    base: SeriesBase
    """Base of the fits."""
    change: LikeliestChange
    """Likeliest change up to each point from the 9th on."""
    sign: int
    """1 where it looks for falls, -1 where for rises."""

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
        return _fall(self.base, self.change, alarm - FIRST_JUDGED + 1, self.sign)


def newest_change(y: Floats) -> Fall | None:
    """The fall, or with a negative size the rise, that the last two points (n,) are both sure of; None without one."""
    if y.size <= FIRST_JUDGED:
        return None
    base = base_of(y)
    for sign, change in zip((1, -1), _likeliest_changes(base, np.arange(y.size - 2, y.size)), strict=True):
        if (change.score >= SURE).all():
            fall = _fall(base, change, -1, sign)
            return fall._replace(size=sign * fall.size)
    return None


def watch(y: Floats, temperature: Floats | None = None) -> Watch:
    """Judge a series (n,) point after point: whether it falls.

    temperature: of the spindle (K or degC) at each point, NaN where it was not recorded; its influence is fitted along.
    """
    return watch_both(y, temperature)[0]


def watch_both(y: Floats, temperature: Floats | None = None) -> tuple[Watch, Watch]:
    """Judge a series likewise, and its mirror image: whether it rises."""
    base, unjudged = base_of(y, temperature), np.full(min(y.size, FIRST_JUDGED - 1), np.nan)
    falls, rises = _likeliest_changes(base, np.arange(unjudged.size, y.size)) if y.size >= FIRST_JUDGED else NOTHING
    down, up = (np.concatenate([unjudged, change.score]) for change in (falls, rises))
    return Watch(down, base, falls, 1), Watch(up, base, rises, -1)


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
    scores = -ndtri(stdtr(n - 2, -np.maximum(*t)))
    fell = t[0] >= t[1]
    return LikeliestChange(scores, fell, np.where(fell, points[0], points[1]))


def _fall(base: SeriesBase, change: LikeliestChange, at: int, sign: int) -> Fall:
    """The change up to one of the points, fitted to the whole series; at: index of that point."""
    kind: Kind = "step" if change.fell[at] else "slope"
    n, point = base.y.size, int(change.point[at])
    beta, error = base.fit_change(kind, n, point)
    length = n - 1 - point if kind == "slope" else 1
    return Fall(kind, point, -sign * beta * length, error * length * float(stdtrit(n - 2, 0.975)))
