"""Forecast when a falling series reaches a level, by a weighted mixture of trend shapes.

Weights by the residual sum of squares and the number of shapes of a kind (an approximation of Bayesian model
averaging with equal prior weight of each kind; Raftery 1995, "Bayesian model selection in social research"). No
random numbers.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy

from lobewatch.arrays import Floats
from lobewatch.monitoring import trend_shapes
from lobewatch.monitoring.level_model import build_level_model
from lobewatch.monitoring.series_points import Readings
from lobewatch.monitoring.trend_shapes import SHAPE_KINDS, FitFamily, TrendShape

MIN_FORECAST_POINTS = 8
"""Smallest number of points for a forecast; chosen."""
CROSSING_QUANTILES = (0.1, 0.5, 0.9)
"""Probabilities at which a level counts as reached: earliest, probable and latest date; chosen."""
N_FORECAST_DATES = 241
"""Number of dates checked up to the horizon; between them the probability is interpolated."""

DROPPED_SHAPE_WEIGHT = 1e-3
"""Largest total weight of all shapes that are left out."""
MAX_FITTED_POINTS = 120
"""Largest number of fitted points; more points are averaged with their neighbors; chosen."""
NEGLIGIBLE_PROBABILITY = 1e-12
"""Probability that counts as zero."""
INTERVAL_QUANTILES = (0.025, 0.975)
"""Quantiles of the 95 % interval of a rate or a drop."""
QUANTILE_HALVINGS = 30
"""Number of halvings in the search for a quantile of a mixture."""
FAN_HALVINGS = 30
"""Number of halvings in the search for the inverse hyperbolic sine of a quantile of a fan, as curves run far away."""
WINSORIZED_QUANTILES = (0.1, 0.9)
"""Quantiles of the shapes to which the mean line limits them; chosen."""
FAN_STANDARD_ERRORS = 50
"""Standard errors around the means within which all quantiles are searched."""


class DateRange(NamedTuple):
    """Dates at which a level is reached, in units of the series."""

    earliest: float
    """Date at a probability of 10 %; -inf if reached at the last point, inf if not before the horizon."""
    probable: float
    """Date at a probability of 50 %."""
    latest: float
    """Date at a probability of 90 %."""


class Rate(NamedTuple):
    """Rate of change of a series at its last point, in its unit per unit of its dates."""

    value: float
    """Mean of the mixture; negative for a drop."""
    low: float
    """2.5 % quantile."""
    high: float
    """97.5 % quantile."""


class Forecast(NamedTuple):
    """Mixture of all shapes of a trend."""

    shapes: tuple[TrendShape, ...]
    """Fitted shapes, j of them."""
    weight: Floats
    """Weight of each shape, sum 1, shape (j,)."""
    spread: float
    """Standard deviation of the points around the shapes, in the unit of the series."""
    fitted: Floats
    """Mean of the mixture at the points, shape (n,)."""
    dates: Floats
    """Dates from the last point to the horizon, shape (d,)."""
    mean: Floats
    """Mean of each shape at these dates, shape (j, d)."""
    error: Floats
    """Standard error of these means, shape (j, d)."""
    freedom: Floats
    """Degrees of freedom of the errors of each shape, shape (j,)."""

    @property
    def mean_line(self) -> Floats:
        """Winsorized mean of the shapes at the dates, shape (d,); curves that run away do not carry it off."""
        order = np.argsort(self.mean, axis=0)
        ordered, share = np.take_along_axis(self.mean, order, 0), np.cumsum(self.weight[order], axis=0)
        places = [(share < quantile).sum(axis=0)[np.newaxis] for quantile in WINSORIZED_QUANTILES]
        low, high = (np.take_along_axis(ordered, place, 0) for place in places)
        return np.asarray(self.weight @ np.clip(self.mean, low, high))

    @property
    def likeliest(self) -> TrendShape:
        """Shape with the largest weight, of the kind with the largest weight."""
        kinds = np.array([shape.kind for shape in self.shapes])
        heaviest = max(SHAPE_KINDS, key=lambda kind: self.weight[kinds == kind].sum())
        return self.shapes[int(np.argmax(np.where(kinds == heaviest, self.weight, -1.0)))]

    def probability(self, level: float | Floats, error: float = 0.0) -> Floats:
        """Return the probability of being below a level (one, or one a date) at the dates, shape (d,)."""
        away = level - self.mean
        away /= np.hypot(self.error, error) if error else self.error
        return np.asarray(self.weight @ _student_cdf(self.freedom, away))

    def crossing_dates(self, level: float, error: float = 0.0) -> DateRange:
        """Return the dates at which a level (with its standard error) is reached."""
        chance = np.maximum.accumulate(self.probability(level, error))
        return DateRange(*(self._first(chance, quantile) for quantile in CROSSING_QUANTILES))

    def _first(self, chance: Floats, quantile: float) -> float:
        above = int(np.searchsorted(chance, quantile))
        if above in (0, chance.size):
            return -np.inf if above == 0 else np.inf
        return float(np.interp(quantile, chance[above - 1 : above + 1], self.dates[above - 1 : above + 1]))

    def quantile_line(self, quantile: float) -> Floats:
        """Return the quantile of the series at the dates, shape (d,)."""
        unit, reach = self.error.min(axis=0), FAN_STANDARD_ERRORS * self.error
        low, high = (
            np.arcsinh((self.mean - reach).min(axis=0) / unit),
            np.arcsinh((self.mean + reach).max(axis=0) / unit),
        )
        for _ in range(FAN_HALVINGS):
            middle = (low + high) / 2
            below = self.probability(unit * np.sinh(middle)) < quantile
            low, high = np.where(below, middle, low), np.where(below, high, middle)
        return np.asarray(unit * np.sinh((low + high) / 2))


def forecast_series(dates: Floats, y: Floats, horizon: float, temperature: Floats | None = None) -> Forecast:
    """Forecast a series y (n,) over its increasing dates (n,) to a date, at most twice its own span ahead.

    temperature: at each point (K or degC), NaN where it was not recorded. ValueError below 8 points and without a
    span.
    """
    return fit_past(dates, Readings(y, temperature)).forecast(horizon)


class PastFit(NamedTuple):
    """Fits of all shapes to a series, the part of a forecast that does not depend on today."""

    families: tuple[FitFamily, ...]
    """Fitted shapes, with dates from the first point on."""
    weight: Floats
    """Weight of each shape, sum 1, shape (j,)."""
    fitted: Floats
    """Mean of the mixture at the points, shape (n,)."""
    dates: Floats
    """Dates of the points, shape (n,)."""
    first_value: float
    """Value of the first point."""
    spread: float
    """Standard deviation of the points around the shapes without random walk, in the unit of the series."""
    n_fitted: int
    """Number of fitted points, one less than that of the dates if the newest one is left out."""

    def forecast(self, horizon: float) -> Forecast:
        """Forecast until a date."""
        begin, span = float(self.dates[0]), float(self.dates[-1] - self.dates[0])
        at = np.linspace(span, min(max(horizon - begin, span), 3 * span), N_FORECAST_DATES)
        mean, error = (np.concatenate(blocks) for blocks in zip(*(f.predict(at) for f in self.families), strict=True))
        shapes = tuple(shape._replace(start=shape.start + begin) for family in self.families for shape in family.shapes)
        dates, mean = begin + at, mean + self.first_value
        return Forecast(shapes, self.weight, self.spread, self.fitted, dates, mean, error, self.freedom)

    @property
    def freedom(self) -> Floats:
        """Degrees of freedom of each shape, shape (j,)."""
        return np.concatenate([np.full(len(family.shapes), family.freedom) for family in self.families])

    @property
    def rate(self) -> Rate:
        """Rate of change at its last point."""
        rate, error = (np.concatenate(rates) for rates in zip(*(f.rate() for f in self.families), strict=True))
        low, high = (mixture_quantile(self.weight, rate, error, self.freedom, p) for p in INTERVAL_QUANTILES)
        return Rate(float(self.weight @ rate), low, high)


def fit_past(dates: Floats, readings: Readings) -> PastFit:
    """Fit all shapes to a series over its increasing dates (n,)."""
    at, y = dates - dates[:1].sum(), readings.y
    if y.size < MIN_FORECAST_POINTS or at[-1] <= 0:
        needed = f"a forecast needs {MIN_FORECAST_POINTS} points on several dates"
        raise ValueError(f"{y.size} points on {np.unique(at).size} dates, but {needed}")
    places = average_neighbors(at)
    base = build_level_model(average_readings(readings))
    families = trend_shapes.fit_shapes(base, places)
    kept, weight = _select_heaviest([*families, *trend_shapes.fit_random_walks(base, places)])
    first = average_neighbors(y)[0]
    fitted = weight @ np.concatenate([family.predict(at)[0] for family in kept]) + first
    spread = _point_spread(families) * np.sqrt(at.size / places.size)
    return PastFit(kept, weight, fitted, dates, float(first), spread, at.size)


def _point_spread(families: Sequence[trend_shapes.ShapeFits]) -> float:
    evidence = np.concatenate([family.evidence for family in families])
    variance = np.concatenate([family.variance for family in families])
    weight = np.exp(evidence - evidence.max())
    return float(np.sqrt(weight @ variance / weight.sum()))


def average_neighbors(values: Floats) -> Floats:
    """Average neighbors where there are many."""
    return np.array([part.mean() for part in np.array_split(values, min(values.size, MAX_FITTED_POINTS))])


def average_readings(readings: Readings) -> Readings:
    """Average readings; operators count only where each reading is one point."""
    if readings.y.size <= MAX_FITTED_POINTS:
        return readings
    temperature = None if readings.temperature is None else average_neighbors(readings.temperature)
    return Readings(average_neighbors(readings.y), temperature)


def _select_heaviest(families: Sequence[FitFamily]) -> tuple[tuple[FitFamily, ...], Floats]:
    """Drop the shapes that together have next to no weight, and return the weights of the others."""
    log = np.concatenate([family.evidence for family in families])
    weight = np.exp(log - log.max())
    order = np.argsort(weight)
    light = np.zeros(weight.size, dtype=bool)
    light[order] = np.cumsum(weight[order]) < DROPPED_SHAPE_WEIGHT * weight.sum()
    parts = np.split(~light, np.cumsum([len(family.shapes) for family in families])[:-1])
    kept = [family.select(np.flatnonzero(part)) for family, part in zip(families, parts, strict=True) if part.any()]
    return tuple(kept), weight[~light] / weight[~light].sum()


def _student_cdf(freedom: Floats, t: Floats) -> Floats:
    """Return the distribution of Student's t (j, d) with degrees of freedom (j,)."""
    freedom = np.broadcast_to(freedom[:, np.newaxis], t.shape)
    near = ~(np.abs(t) > scipy.special.stdtrit(freedom[:, :1], 1 - NEGLIGIBLE_PROBABILITY))
    share = (t > 0).astype(np.float64)
    share[near] = scipy.special.stdtr(freedom[near], t[near])
    return np.asarray(share)


def mixture_quantile(weight: Floats, middle: Floats, error: Floats, freedom: Floats, p: float) -> float:
    """Return a quantile of a mixture of Student's t; an error of 0 is a value that is certain.

    It is between the smallest and the largest quantile of the parts.
    """
    parts = middle + scipy.special.stdtrit(freedom, p) * error
    low, high = float(parts.min()), float(parts.max())
    for _ in range(QUANTILE_HALVINGS):
        value = (low + high) / 2
        with np.errstate(invalid="ignore", divide="ignore"):
            below = np.where(error > 0, scipy.special.stdtr(freedom, (value - middle) / error), middle <= value)
        low, high = (value, high) if weight @ below < p else (low, value)
    return high
