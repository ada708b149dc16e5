"""The watch over a series for a fall: the change-point model, judged anew at each point.

Hawkins, Qiu & Kang (2003), "The changepoint model for statistical process control", Journal of Quality
Technology 35(4), with hinges beside the steps, one-sided.
"""

from __future__ import annotations

from dataclasses import dataclass
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


@dataclass(frozen=True, eq=False)
class Watch:
    """Judgement on the points of a series, one after the other."""

    scores: Floats
    """Score of each point: how ill a steady series fits up to it, as a quantile of the normal distribution, shape (n,);
    NaN before the 9th."""
    alarm_at: int | None
    """Index of the point that raised the alarm, the second one running that is sure; None where there is none."""
    fall: Fall | None
    """Kind and beginning as they were when the alarm was raised, size as it is now; None without alarm."""

    @property
    def asks_again(self) -> bool:
        """Whether the newest point is sure of a fall that the one before it was not."""
        return self.alarm_at is None and self.scores.size > 0 and bool(self.scores[-1] >= SURE)


class LikeliestChange(NamedTuple):
    """The likeliest change in the points up to each of some of them."""

    score: Floats
    """Score: how ill a steady series fits, as a quantile of the normal distribution, shape (r,)."""
    fell: NDArray[np.bool_]
    """Whether the change is a step, shape (r,)."""
    point: NDArray[np.intp]
    """Index of its point as in Fall, shape (r,)."""


def calls_for_another(y: Floats, temperature: Floats) -> bool:
    """Whether the last point of a series (n,) is sure of a fall that the one before it was not."""
    if y.size < FIRST_JUDGED:
        return False
    last = np.arange(max(y.size - 2, FIRST_JUDGED - 1), y.size)
    sure = _likeliest_changes(base_of(y, temperature), last)[0].score >= SURE
    return bool(sure[-1] and not (sure.size > 1 and sure[0]))


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
    base = base_of(y, temperature)
    if y.size < FIRST_JUDGED:
        unknown = Watch(np.full(y.size, np.nan), None, None)
        return unknown, unknown
    falls, rises = _likeliest_changes(base, np.arange(FIRST_JUDGED - 1, y.size))
    return _watch(base, falls, 1), _watch(base, rises, -1)


def _watch(base: SeriesBase, change: LikeliestChange, sign: int) -> Watch:
    """The watch from the likeliest change up to each point that is judged; sign: 1 for falls, -1 for rises."""
    scores = np.full(base.y.size, np.nan)
    scores[FIRST_JUDGED - 1 :] = change.score
    with np.errstate(invalid="ignore"):
        sure = scores >= SURE
    twice = np.flatnonzero(sure[1:] & sure[:-1]) + 1
    if not twice.size:
        return Watch(scores, None, None)
    at = int(twice[0])
    return Watch(scores, at, _fall(base, change, at - FIRST_JUDGED + 1, sign))


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
