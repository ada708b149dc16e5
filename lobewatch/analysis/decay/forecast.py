"""When a falling series will reach a level: a mixture of all shapes that its past allows, each with its own error.

Weights by the residual sum of squares and the number of shapes of a kind (an approximation of Bayesian model
averaging with equal prior weight of each kind; Raftery 1995, "Bayesian model selection in social research"). No random
numbers.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr

from lobewatch.analysis.decay.temperature import base_of

ENOUGH = 8
"""Points from which on anything is foretold."""
RATES = (-4.0, -2.0, -1.0, 1.0, 2.0, 3.0, 4.0, 6.0)
"""Of the exponential curves, over the span of the series."""
POWERS = (1.5, 2.0, 3.0)
"""Of the power curves."""
QUANTILES = (0.1, 0.5, 0.9)
"""Probabilities at which a level counts as reached: earliest, probable and latest date."""
LOOKS = 241
"""Dates looked at up to the horizon; between them the probability is interpolated."""

LIGHTEST = 1e-7
"""Weight beside the heaviest below which a shape is left out."""
HALVINGS = 40
"""Of the range in which a quantile is looked for."""

Floats = NDArray[np.float64]
Kind = Literal["none", "line", "slope", "step", "curve"]
KINDS: tuple[Kind, ...] = ("none", "line", "slope", "step", "curve")


class Shape(NamedTuple):
    """One way in which a series may have come about."""

    kind: Kind
    """"none": steady; "slope": a line from a point on; "step": fallen once; "curve": accelerating or slowing down."""
    start: float
    """Date from which on it falls, or on which it fell."""
    accelerates: bool = False
    """Of a curve; else it slows down."""


class Reached(NamedTuple):
    """When a level is reached, as dates of the series."""

    earliest: float
    """At a probability of 10 %; -inf where it is reached already, inf where not before the horizon."""
    probable: float
    """At 50 %."""
    latest: float
    """At 90 %."""


@dataclass(frozen=True, eq=False)
class Forecast:
    """What a series may become."""

    shapes: tuple[Shape, ...]
    """All that were fitted, j of them."""
    weight: Floats
    """Of each, shape (j,), their sum 1."""
    spread: float
    """Standard deviation of the points around the shapes, in the unit of the series."""
    fitted: Floats
    """Mean of the mixture at the points themselves, shape (n,)."""
    dates: Floats
    """From now to the horizon, shape (d,); where that has passed, all are the horizon."""
    mean: Floats
    """Of each shape at these dates, shape (j, d)."""
    error: Floats
    """Standard error of these means, shape (j, d)."""
    freedom: int
    """Degrees of freedom of the errors."""

    @property
    def line(self) -> Floats:
        """Mean of the mixture at the dates, shape (d,)."""
        return np.asarray(self.weight @ self.mean)

    @property
    def likeliest(self) -> Shape:
        """The heaviest shape of the heaviest kind."""
        kinds = np.array([shape.kind for shape in self.shapes])
        heaviest = max(KINDS, key=lambda kind: self.weight[kinds == kind].sum())
        return self.shapes[int(np.argmax(np.where(kinds == heaviest, self.weight, -1.0)))]

    def probability(self, level: float | Floats, error: float = 0.0) -> Floats:
        """That the series is below a level (one, or one a date; with its standard error) at the dates, shape (d,)."""
        return np.asarray(self.weight @ stdtr(self.freedom, (level - self.mean) / np.hypot(self.error, error)))

    def reached(self, level: float, error: float = 0.0) -> Reached:
        """When a level (with its standard error) is reached."""
        chance = np.maximum.accumulate(self.probability(level, error))
        return Reached(*(self._first(chance, quantile) for quantile in QUANTILES))

    def _first(self, chance: Floats, quantile: float) -> float:
        above = int(np.searchsorted(chance, quantile))
        if above in (0, chance.size):
            return -np.inf if above == 0 else np.inf
        return float(np.interp(quantile, chance[above - 1 : above + 1], self.dates[above - 1 : above + 1]))

    def fan(self, quantile: float) -> Floats:
        """Level below which the series is with a probability at the dates, shape (d,)."""
        low, high = (self.mean - 50 * self.error).min(axis=0), (self.mean + 50 * self.error).max(axis=0)
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            below = self.probability(middle) < quantile
            low, high = np.where(below, middle, low), np.where(below, high, middle)
        return np.asarray((low + high) / 2)


def forecast(
    dates: Floats, y: Floats, horizon: float, temperature: Floats | None = None, now: float = -np.inf
) -> Forecast:
    """Foretell a series y (n,) over its dates (n,), increasing, to a date, but never farther than twice its own span.

    temperature: at each point (K or degC), NaN where it was not recorded; now: if that is later than the last point.
    ValueError below 8 points and without a span.
    """
    at = dates - dates[:1].sum()
    if y.size < ENOUGH or at[-1] <= 0:
        raise ValueError(f"{y.size} points on {np.unique(at).size} dates: a forecast needs {ENOUGH}")
    farthest = 3 * at[-1]
    start = min(max(at[-1], now - dates[0]), farthest)
    ahead = np.linspace(start, max(min(horizon - dates[0], farthest), start), LOOKS)
    base = base_of(y, temperature)
    shapes, columns = zip(*_shapes(at, np.concatenate([at, ahead])), strict=True)
    rss, mean, error = base.fit_columns(np.array(columns), at.size)
    kinds = np.array([shape.kind for shape in shapes])
    share = {kind: np.log(np.sum(kinds == kind)) + np.log(y.size) / 2 * (kind != "none") for kind in KINDS}
    log = -base.freedom / 2 * np.log(rss) - [share[kind] for kind in kinds]
    weight = np.exp(log - log.max())
    kept = np.flatnonzero(weight > LIGHTEST)
    weight = weight[kept] / weight[kept].sum()
    moved = tuple(shapes[j]._replace(start=shapes[j].start + float(dates[0])) for j in kept)
    spread = float(np.sqrt(weight @ rss[kept] / base.freedom))
    past, mean = np.split(mean[kept] + y[0], [at.size], axis=1)
    return Forecast(moved, weight, spread, weight @ past, dates[0] + ahead, mean, error[kept, at.size :], base.freedom)


def _shapes(at: Floats, all_dates: Floats) -> Iterator[tuple[Shape, Floats]]:
    """All that are tried, and how each runs over all dates; both count from the first point on."""
    span = at[-1]
    yield Shape("none", 0.0), np.zeros(all_dates.size)
    yield Shape("line", 0.0), all_dates
    yield from ((Shape("slope", float(one)), np.maximum(all_dates - one, 0.0)) for one in at[1:-3])
    yield from ((Shape("step", float(one)), (all_dates >= one).astype(np.float64)) for one in at[2:-1])
    yield from ((Shape("curve", 0.0, rate > 0), np.expm1(rate * all_dates / span)) for rate in RATES)
    yield from ((Shape("curve", 0.0, True), (all_dates / span) ** power) for power in POWERS)
