"""Whether a series has begun to fall: the change-point model, judged anew at each point.

Hawkins, Qiu & Kang (2003), "The changepoint model for statistical process control", Journal of Quality
Technology 35(4), with hinges beside the steps, one-sided.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri, stdtr, stdtrit

from lobewatch.analysis.decay.temperature import Base, base_of

FIRST_JUDGED = 9
"""Points before which nothing is judged."""
SURE = 3.3
"""Score from which a change is taken for real: a chance of 1 in 2000 where only the last point is looked at."""
ROWS = 64
"""Points that are judged at once, to bound the memory."""

Floats = NDArray[np.float64]
Kind = Literal["step", "slope"]


class Fall(NamedTuple):
    """A change of a series, as it is fitted to a number of its points."""

    kind: Kind
    """Whether it fell at once, or has been falling since."""
    point: int
    """Index of the first point after the step, or of the last one before the slope."""
    size: float
    """Fall from there to the last point fitted, in the unit of the series."""
    half_width: float
    """Half the width of the 95 % interval of the size."""


@dataclass(frozen=True, eq=False)
class Watch:
    """What the points of a series have called for, one after the other."""

    scores: Floats
    """How ill a steady series fits, as a quantile of the normal distribution, shape (n,); NaN before the 9th."""
    alarm_at: int | None
    """Index of the point that raised the alarm, the second one running that is sure; None where there is none."""
    fall: Fall | None
    """Kind and beginning as they were when the alarm was raised, size as it is now; None without alarm."""

    @property
    def asks_again(self) -> bool:
        """Whether the newest point is sure of a fall that the one before it was not."""
        return self.alarm_at is None and self.scores.size > 0 and bool(self.scores[-1] >= SURE)


def calls_for_another(y: Floats, temperature: Floats) -> bool:
    """Whether the last point of a series (n,) is sure of a fall that the one before it was not."""
    if y.size < FIRST_JUDGED:
        return False
    last = np.arange(max(y.size - 2, FIRST_JUDGED - 1), y.size)
    sure = [score >= SURE for score, _, _ in _best(base_of(y, temperature), last)]
    return sure[-1] and not (len(sure) > 1 and sure[0])


def watch(y: Floats, temperature: Floats | None = None) -> Watch:
    """Judge a series (n,) point after point.

    temperature: of the spindle (K or degC) at each point, NaN where it was not recorded; its influence is fitted along.
    """
    base = base_of(y, temperature)
    starts = range(FIRST_JUDGED - 1, y.size, ROWS)
    best = [one for start in starts for one in _best(base, np.arange(start, min(start + ROWS, y.size)))]
    scores = np.full(y.size, np.nan)
    scores[FIRST_JUDGED - 1 :] = [score for score, _, _ in best]
    with np.errstate(invalid="ignore"):
        sure = scores >= SURE
    twice = np.flatnonzero(sure[1:] & sure[:-1]) + 1
    if not twice.size:
        return Watch(scores, None, None)
    at = int(twice[0])
    _, kind, point = best[at - FIRST_JUDGED + 1]
    return Watch(scores, at, _fall(base, kind, point))


def _best(base: Base, last: NDArray[np.intp]) -> Iterator[tuple[float, Kind, int]]:
    """Score, kind and index of the likeliest fall in the points up to each of these."""
    n = last[:, np.newaxis] + 1
    k = np.arange(last[-1] + 1)
    t = {}
    for kind, allowed in (("step", (k >= 2) & (k <= n - 2)), ("slope", (k >= 1) & (k <= n - 3))):
        beta, error = base.fit_change(kind, n, k)
        t[kind] = np.where(allowed, -beta / error, -np.inf)
    for row, index in enumerate(last):
        likeliest: Kind = "step" if t["step"][row].max() >= t["slope"][row].max() else "slope"
        point = int(np.argmax(t[likeliest][row]))
        yield -float(ndtri(stdtr(index - 1, -t[likeliest][row, point]))), likeliest, point


def _fall(base: Base, kind: Kind, point: int) -> Fall:
    n = base.y.size
    beta, error = base.fit_change(kind, np.array([[n]]), np.array([point]))
    length = n - 1 - point if kind == "slope" else 1
    half_width = float(error[0, 0]) * length * float(stdtrit(n - 2, 0.975))
    return Fall(kind, point, -float(beta[0, 0]) * length, half_width)
