"""Newest point of a series: whether the one before it confirms it, and the fit of the past without it if not."""

import math

import numpy as np

from lobewatch.arrays import Floats
from lobewatch.monitoring.change_detection import detect_changes
from lobewatch.monitoring.forecast import MIN_FORECAST_POINTS, PastFit, fit_past
from lobewatch.monitoring.level_model import MIN_SCATTER, build_level_model
from lobewatch.monitoring.series_points import (
    CONFIRMED_DISTANCE_SHARE,
    MAD_TO_STD,
    MIN_REFERENCE_POINTS,
    N_REFERENCE_POINTS,
    Readings,
)

MAX_UNCONFIRMED_DISTANCE = 2.0
"""Distance (standard deviations) of the newest point from earlier ones, up to which it needs no other; chosen."""
MIN_EXPECTED_SHARE = 0.025
"""Probability on each side, below which a point is not as its forecast expected it; chosen."""


def measure_newest_distance(y: Floats) -> float:
    """Measure how far the newest point of a series is from earlier ones.

    Parameters
    ----------
    y
        Values of the series, shape (n,).

    Returns
    -------
    float
        Distance from the median of the seven points before it, in robust standard deviations. 0 if the point before
        it is as far, or nearly, and below four points.
    """
    if y.size <= MIN_REFERENCE_POINTS:
        return 0.0
    middle = float(np.median(y[-1 - N_REFERENCE_POINTS : -1]))
    away, before = float(y[-1]) - middle, float(y[-2]) - middle
    scatter = MAD_TO_STD / math.sqrt(2) * float(np.median(np.abs(np.diff(y[:-1]))))
    if not away or before / away >= CONFIRMED_DISTANCE_SHARE:
        return 0.0
    return away / max(scatter, MIN_SCATTER)


def fit_confirmed_past(days: Floats, readings: Readings) -> PastFit | None:
    """Fit the past of a series without its newest point if nothing confirms that point yet.

    Parameters
    ----------
    days
        Days of use of the points, shape (n,).
    readings
        Series.

    Returns
    -------
    PastFit or None
        Fit of the confirmed points, with its line at all of them and at the newest one. None if fewer than eight are
        confirmed.
    """
    level = build_level_model(readings)
    if abs(measure_newest_distance(level.y)) <= MAX_UNCONFIRMED_DISTANCE:
        return fit_past(days, readings) if days.size >= MIN_FORECAST_POINTS else None
    if days.size <= MIN_FORECAST_POINTS:
        return None
    earlier = fit_past(days[:-1], readings.until(days.size - 1))
    near = earlier.forecast(float(days[-1]))
    below = near.probability(readings.y[0] + level.y[-1], earlier.spread)[-1]
    is_expected = MIN_EXPECTED_SHARE <= below <= 1 - MIN_EXPECTED_SHARE
    drops = detect_changes(readings).open_drops
    if drops and (is_expected or drops[-1].triggered_at == days.size - 1):
        return fit_past(days, readings)
    return earlier._replace(dates=days, fitted=np.append(earlier.fitted, near.quantile_line(0.5)[-1]))
