"""Drop of a series since its start, with the 95 % interval that contains reclamping.

The one place that computes a drop. The newest value is compared with the start of the series, both at the mean
temperature and for the mean of the operators. The scatter of a point is unknown: its posterior comes from the points,
from other series, or from the range of scatters that spindles show, and the interval from the mixture over it.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
import scipy

from lobewatch.arrays import Floats
from lobewatch.monitoring.change_detection import SURE_CHANGE_SCORE
from lobewatch.monitoring.forecast import MIN_FORECAST_POINTS, PastFit
from lobewatch.monitoring.level_model import (
    MIN_SCATTER,
    OPERATOR_SPREAD,
    STEEL_FREQUENCY_PER_KELVIN,
    LevelModel,
    build_level_model,
)
from lobewatch.monitoring.series_points import (
    CONFIRMED_DISTANCE_SHARE,
    MIN_CLAMPING_ERROR,
    Readings,
    ScatterPrior,
)

USUAL_SCATTER = 0.05, 0.6
"""Range of the scatter of f1 from reclamping (%) before it is measured: 0.05 to 0.5 is usual, and the upper end is
higher so that the interval holds at 0.5 too; chosen."""
MEASURED_SCATTER_RANGE = 0.1, 10.0
"""Range of scatters over the estimated one, to which a posterior is computed."""
N_SCATTERS = 48
"""Number of scatters of a posterior."""
INTERVAL_PROBABILITY = 0.95
"""Probability of the stated interval."""
N_START_POINTS = 3
"""Number of first points that define the start of a series without a fitted line; chosen."""
HIGHEST_SQUARE = 1.0, 1.0, 1 + math.sqrt(3) / (2 * math.pi)
"""Mean square of the highest of one, two and three standard normal numbers."""
STEADY_ODDS = 100.0
"""Factor on the weight of a steady series for its start: most spindles do not drop; chosen. In a forecast, where a
missed drop costs more, it has none."""
N_HALVINGS = 50
"""Number of halvings in the search for a quantile."""


class ScatterPosterior(NamedTuple):
    """Posterior of the standard deviation of a point."""

    scatter: Floats
    """Possible scatters (%), shape (s,)."""
    weight: Floats
    """Probability of each, sum 1, shape (s,)."""

    @classmethod
    def measured(cls, squares: float, freedom: float, known: ScatterPrior) -> Self:
        """Return the posterior of a sum of squares (%^2) with degrees of freedom, pooled with those of a prior."""
        squares, freedom = squares + known.freedom * known.percent**2, freedom + known.freedom
        middle = max(math.sqrt(squares / freedom), MIN_SCATTER)
        low, high = (max(end * middle, MIN_SCATTER) for end in MEASURED_SCATTER_RANGE)
        return cls.between(low, high, squares, freedom)

    @classmethod
    def between(cls, low: float, high: float, squares: float, freedom: float) -> Self:
        """Return the posterior of a sum of squares (%^2) with degrees of freedom, in a range of scatters (%)."""
        scatter = np.geomspace(low, high, N_SCATTERS)
        log = -freedom * np.log(scatter) - squares / (2 * scatter**2)
        weight = np.exp(log - log.max())
        return cls(scatter, weight / weight.sum())

    @property
    def percent(self) -> float:
        """Root mean square of the scatter (%)."""
        return float(np.sqrt(self.weight @ self.scatter**2))

    def tail(self, size: float, lever: float, error: float) -> float:
        """Return the probability that an error is larger than a size (%): one-sided; see `half_width`."""
        std = np.sqrt(lever * self.scatter**2 + error**2)
        return float(self.weight @ scipy.special.ndtr(-size / std))

    def half_width(self, lever: float, error: float = 0.0) -> float:
        """Return half the width of the 95 % interval (%).

        lever: variance over that of a point; error: further standard error (%).
        """
        low, high = 0.0, 10.0 * math.sqrt(lever * float(self.scatter[-1]) ** 2 + error**2)
        for _ in range(N_HALVINGS):
            middle = (low + high) / 2
            is_inside = 2 * self.tail(middle, lever, error) > 1 - INTERVAL_PROBABILITY
            low, high = (middle, high) if is_inside else (low, middle)
        return high


class SeriesDrop(NamedTuple):
    """Drop of a value since the start of its series (%)."""

    value: float
    """Drop; NaN if unknown, negative for a rise."""
    std: float = math.nan
    """Standard error with reclamping; 0 for the first test."""
    half_width: float = math.nan
    """Half the width of the 95 % interval; 0 for the first test."""
    is_proven: bool = False
    """True if the drop or rise has at least the score of an alarm."""

    @property
    def is_known(self) -> bool:
        """True if there is a value."""
        return math.isfinite(self.value)

    @property
    def interval(self) -> tuple[float, float] | None:
        """Ends of the 95 % interval (%); None if unknown."""
        return (self.value - self.half_width, self.value + self.half_width) if self.is_known else None


UNKNOWN_DROP = SeriesDrop(math.nan)
"""Drop of a series without a value."""
NO_DROP = SeriesDrop(0.0, 0.0, 0.0)
"""Drop at the first test."""


class ConditionEffects(NamedTuple):
    """Effects of temperature and operators, relative to the mean conditions of a series."""

    mean_temperature: float = math.nan
    """Mean temperature of the points; NaN if it has no effect."""
    operators: tuple[str, ...] = ()
    """Operators with an effect, o of them."""
    mean: Floats = np.empty(0)
    """Mean of the columns: the temperature, if any, and the operators, shape (p,)."""
    size: Floats = np.empty(0)
    """Effect of each column (%), shape (p,)."""
    covariance: Floats = np.empty((0, 0))
    """Covariance of the effects over the variance of a point, shape (p, p)."""

    def at(self, temperature: float, operator: str) -> tuple[float, float]:
        """Return the effect (%) of conditions, and its variance over that of a point."""
        warmer = temperature - self.mean_temperature
        columns = [] if math.isnan(self.mean_temperature) else [0.0 if math.isnan(warmer) else warmer]
        columns += [float(name == operator) for name in self.operators]
        away = np.array(columns) - self.mean
        unknown = OPERATOR_SPREAD**2 if operator and self.operators and operator not in self.operators else 0.0
        return float(away @ self.size), float(away @ self.covariance @ away) + unknown


NO_EFFECTS = ConditionEffects()
"""Effects where too few points tell any."""


@dataclass(frozen=True, eq=False)
class DropModel:
    """Start and scatter of a series, by which each value becomes a drop."""

    start: float
    """Start (%): 100 ln of the value over that of the first test, at the mean conditions."""
    start_variance: float
    """Variance of the start over that of a point."""
    start_error: float
    """Standard error of the start from its tap test alone (%); 0 where the measured scatter contains it."""
    scatter: ScatterPosterior
    """Posterior of the scatter of a point."""
    effects: ConditionEffects = NO_EFFECTS
    """Effects of the conditions."""
    first_distance: float = 0.0
    """Distance of one of the first points from the next ones (%) that counts as badly clamped, else 0. The start may
    be there."""
    first_outlier: int = 0
    """Index of that point."""
    is_short: bool = False
    """True if the scatter is not measured, so that it does not contain the errors of the tap tests."""

    def percent_below_start(self, percent: float, temperature: float, operator: str) -> float:
        """Return the drop (%) of a value, given as 100 ln over the first test, at the mean conditions."""
        return -100 * math.expm1((percent - self.effects.at(temperature, operator)[0] - self.start) / 100)

    def drop_at(self, value: float, temperature: float, operator: str, error: float) -> SeriesDrop:
        """Return a drop (%) with its interval; error: standard error of the value from its tap test alone (%).

        The interval also contains the drop from a first test that counts as badly clamped.
        """
        lever = 1 + self.start_variance + self.effects.at(temperature, operator)[1]
        alone = math.hypot(self.start_error, np.nan_to_num(error) if self.is_short else 0.0)
        ratio, change = 1 - value / 100, abs(100 * math.log1p(-value / 100))
        gap = abs(self.first_distance)
        std = ratio * math.hypot(math.sqrt(lever) * self.scatter.percent, alone, gap / 2)
        is_proven = self.scatter.tail(change - gap, lever, alone) < scipy.special.ndtr(-SURE_CHANGE_SCORE)
        return SeriesDrop(value, std, ratio * (self.scatter.half_width(lever, alone) + gap), bool(is_proven))

    def std(self, error: float) -> float:
        """Return the standard error of one value with reclamping (%); error: from its tap test alone."""
        return math.hypot(self.scatter.percent, float(np.nan_to_num(error)) if self.is_short else 0.0)


def model_drop(readings: Readings, errors: Floats, past: PastFit | None) -> DropModel:
    """Model the drop of a series; errors: of the points from their tap tests alone (%), shape (n,)."""
    return _model_short_series(readings, errors) if past is None else _model_fitted_series(readings, past)


def _model_short_series(readings: Readings, errors: Floats) -> DropModel:
    """Start at the highest of the first three points.

    Its mean square error is that of the highest of as many normal numbers, which contains its bias. A first test
    clamped badly must not hide a drop, and a mean of the first ones would hide that of a spindle that drops from the
    beginning. A drop counts as scatter, which only widens the interval.
    """
    y, first = readings.y, readings.y[:N_START_POINTS]
    seen = {*readings.operators[:N_START_POINTS], *readings.operators[-1:]}
    apart = 1 + OPERATOR_SPREAD**2 if len(seen) > 1 else 1.0
    squares, known = float(np.sum((y - y.mean()) ** 2)), readings.scatter_prior.single
    if known.freedom:
        scatter = ScatterPosterior.measured(squares, y.size - 1.0, known)
    else:
        low, high = USUAL_SCATTER
        scatter = ScatterPosterior.between(low, math.sqrt(apart) * high, squares, y.size - 1.0)
    at = int(np.argmax(first))
    error = float(np.nan_to_num(errors[at]))
    distance, variance = _measure_distance_alone(y, at), HIGHEST_SQUARE[first.size - 1]
    return DropModel(float(first[at]), variance, error, scatter, NO_EFFECTS, distance, at, is_short=True)


def _measure_distance_alone(y: Floats, at: int) -> float:
    """Measure how far (%) a point is above all others (n,); 0 if one is near, or the others scatter or drop as far."""
    others = np.delete(y, at)
    if y.size < N_START_POINTS:
        return 0.0
    above = float(y[at] - others.max())
    is_alone = above > MIN_CLAMPING_ERROR and np.ptp(others) < CONFIRMED_DISTANCE_SHARE * above
    return above if is_alone else 0.0


def _model_fitted_series(readings: Readings, past: PastFit) -> DropModel:
    """Start at the highest of the fitted line at the first eight points, with the scatter around the line."""
    base, freedom = build_level_model(readings), readings.y.size - 2.0
    effects, rest = _fit_effects(base, readings, past)
    start, variance = _fit_start(past)
    spread = max(past.spread, MIN_SCATTER)
    kept = base.columns[:, : 1 + base.n_temperature_columns]
    alone = LevelModel(base.y, base.newest, kept, base.n_temperature_columns).inverse_normal_matrix[0, 0]
    of_operators = float(base.inverse_normal_matrix[0, 0] - alone)
    lever = max(variance / spread**2 - of_operators, 1 / base.y.size)
    scatter = ScatterPosterior.measured(freedom * spread**2, freedom, readings.scatter_prior.single)
    return DropModel(start + rest, lever, 0.0, scatter, effects, base.first_distance)


def _fit_effects(base: LevelModel, readings: Readings, past: PastFit) -> tuple[ConditionEffects, float]:
    """Fit the effects of the conditions to the residuals of the line, and return their mean, too."""
    columns, n_warm = base.columns[: past.n_fitted, 1:], base.n_temperature_columns
    left = (base.y + readings.y[0] - past.fitted)[: past.n_fitted]
    rest = float(left.mean())
    if not columns.size:
        return NO_EFFECTS, rest
    mean = columns.mean(axis=0)
    away, precision = columns - mean, base.precision(np.array([base.y.size]))[0, 1:, 1:]
    covariance = np.asarray(np.linalg.inv(away.T @ away + precision))
    size = covariance @ away.T @ (left - rest)
    size[:n_warm] += STEEL_FREQUENCY_PER_KELVIN
    warm = float(np.nanmean(readings.temperature)) if n_warm and readings.temperature is not None else math.nan
    return ConditionEffects(warm, tuple(dict.fromkeys(filter(None, readings.operators))), mean, size, covariance), rest


def _fit_start(past: PastFit) -> tuple[float, float]:
    """Return the highest of the fitted line at the first points, and its variance."""
    kinds = [shape.kind for family in past.families for shape in family.shapes]
    weight = past.weight * np.where(np.array(kinds) == "none", STEADY_ODDS, 1.0)
    weight /= weight.sum()
    dates = past.dates[:MIN_FORECAST_POINTS] - past.dates[0]
    means, errors = (np.concatenate(part) for part in zip(*(f.predict(dates) for f in past.families), strict=True))
    line = weight @ means
    at = int(np.argmax(line))
    return float(line[at]) + past.first_value, float(weight @ (errors[:, at] ** 2 + (means[:, at] - line[at]) ** 2))
