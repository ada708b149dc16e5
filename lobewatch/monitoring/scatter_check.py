"""Check whether the scatter of a series is independent from point to point, as the alarm assumes."""

import math
from typing import NamedTuple

import numpy as np

from lobewatch.arrays import Floats
from lobewatch.monitoring.forecast import PastFit
from lobewatch.monitoring.series_points import MAD_TO_STD, MAX_OUTLIER_DISTANCE
from lobewatch.monitoring.trend_shapes import RandomWalkFits

MIN_CHECKED_POINTS = 20
"""Smallest number of points to check; chosen."""
CORRELATION_SCORE = 2.33
"""Correlation over its standard deviation from which it is certain: chance of 1 in 100."""
N_LINE_COLUMNS = 2
"""Number of coefficients of a line, which lower the expected correlation of its residuals."""
MIN_GROUP_SHARE = 0.2
"""Smallest share of the points in each of two groups; chosen. Fewer are outliers, such as bad clampings."""
GROUP_SHARE = 2 / math.pi, 0.86
"""Share of the variance that the best division into two groups explains of n normal numbers: its limit, and how far its
99 % quantile is above it times the root of n (measured on 3000 series of 20 to 120 numbers)."""
FALSE_ALARM_SHARES = (0.0, 0.2, 0.4, 0.6, 0.8), (0.024, 0.084, 0.18, 0.41, 0.63)
"""Correlations from point to point, and share of healthy series with a false alarm in 24 points (simulated, see
docs/studies/decay.md)."""


class ScatterCheck(NamedTuple):
    """Result of a check of 20 points or more."""

    correlation: float
    """Correlation of neighbouring points (lag 1)."""
    is_correlated: bool
    """True if that is certain."""
    group_distance: float
    """Distance of two groups of points (%), for example of two undeclared operators; 0 without groups."""

    @property
    def is_independent(self) -> bool:
        """True if neither correlation nor groups are certain."""
        return not self.is_correlated and not self.group_distance

    @property
    def false_alarm_share(self) -> float | None:
        """Share of healthy series with such a scatter that have a false alarm in 24 points; None for groups."""
        if self.group_distance and not self.is_correlated:
            return None
        return float(np.interp(self.correlation if self.is_correlated else 0.0, *FALSE_ALARM_SHARES))


def check_scatter(percents: Floats, past: PastFit | None, *, has_changed: bool) -> ScatterCheck | None:
    """Check the points (n,) of a series at the mean conditions; None below 20 points.

    has_changed: True for a series with a certain change. Its shapes are fitted instead of a line, which removes most
    of the correlation of short series.
    """
    n = percents.size
    if n < MIN_CHECKED_POINTS or past is None:
        return None
    fitted = _fit_without_walks(past) if has_changed else None
    line = np.polynomial.Polynomial.fit(past.dates, percents, 1)(past.dates)
    left = percents - (line if fitted is None else fitted)
    left -= left.mean()
    correlation = _correlate_neighbors(left) + N_LINE_COLUMNS / n
    return ScatterCheck(correlation, correlation * math.sqrt(n) > CORRELATION_SCORE, _find_groups(left))


def _correlate_neighbors(left: Floats) -> float:
    """Return the correlation of neighbouring residuals (n,), clipped so that two outliers do not cause one."""
    limit = MAX_OUTLIER_DISTANCE * MAD_TO_STD * float(np.median(np.abs(left - np.median(left))))
    near = np.clip(left, -limit, limit)
    near -= near.mean()
    return float(near[1:] @ near[:-1]) / max(float(near @ near), np.finfo(float).tiny)


def _fit_without_walks(past: PastFit) -> Floats | None:
    """Return the mean of the shapes without random walks, which would follow correlated scatter, shape (n,).

    None where all others are negligible.
    """
    is_kept = np.concatenate([[not isinstance(f, RandomWalkFits)] * len(f.shapes) for f in past.families])
    if not is_kept.any():
        return None
    means = np.concatenate([family.predict(past.dates - past.dates[0])[0] for family in past.families])
    weight = np.where(is_kept, past.weight, 0.0)
    return np.asarray(weight @ means / weight.sum())


def _find_groups(left: Floats) -> float:
    """Return the distance of two groups of residuals (n,) with mean 0; 0 without certain groups."""
    values, n = np.sort(left), left.size
    low = np.arange(1, n)
    sums = np.cumsum(values)[low - 1]
    between = sums**2 * (1 / low + 1 / (n - low))
    best = int(np.argmax(between))
    limit, above = GROUP_SHARE
    is_outliers = min(low[best], n - low[best]) < MIN_GROUP_SHARE * n
    if is_outliers or between[best] <= (limit + above / math.sqrt(n)) * float(values @ values):
        return 0.0
    return float(-sums[best] * (1 / low[best] + 1 / (n - low[best])))
