"""Points of a series: readings, clampings, days of use, outliers and scatter."""

from bisect import insort
from collections.abc import Sequence
from math import copysign, sqrt
from statistics import median
from typing import NamedTuple, Self

import numpy as np
import scipy

from lobewatch.arrays import Floats, Indices


class ScatterPrior(NamedTuple):
    """Prior of the scatter from point to point, before any is measured."""

    percent: float = 0.0
    """Standard deviation (%)."""
    freedom: float = 0.0
    """Equivalent degrees of freedom; 0 without a prior."""


NO_SCATTER_PRIOR = ScatterPrior()
"""Unknown scatter."""


class SeriesScatterPrior(NamedTuple):
    """Prior of the scatter of a series."""

    single: ScatterPrior = NO_SCATTER_PRIOR
    """Prior for one direction."""
    common: ScatterPrior = NO_SCATTER_PRIOR
    """Prior for the mean of both directions."""


NO_SERIES_PRIOR = SeriesScatterPrior()
"""Unknown scatter of a series."""


class Readings(NamedTuple):
    """Series, point by point."""

    y: Floats
    """Values, shape (n,)."""
    temperature: Floats | None = None
    """Temperature of the spindle (K or degC), NaN if not recorded, shape (n,)."""
    operators: tuple[str, ...] = ()
    """Operator of each point, empty if unknown, n of them; none if operators do not count."""
    other_direction: Floats | None = None
    """Values of the other direction from the same clampings, NaN if there are none, shape (n,)."""
    scatter_prior: SeriesScatterPrior = NO_SERIES_PRIOR
    """Prior of the scatter."""
    days: Floats | None = None
    """Days of use of the points, increasing, shape (n,); evenly spaced if None."""

    def since(self, begin: int) -> Self:
        """Return the points from one on."""
        return self._select(slice(begin, None))

    def until(self, end: int) -> Self:
        """Return the points before one."""
        return self._select(slice(end))

    def _select(self, part: slice) -> Self:
        optional = (self.temperature, self.other_direction, self.days)
        temperature, other, days = (None if values is None else values[part] for values in optional)
        return self._replace(
            y=self.y[part], temperature=temperature, operators=self.operators[part], other_direction=other, days=days
        )

    @property
    def shared_points(self) -> Indices:
        """Points that both directions have."""
        other = self.other_direction
        return np.empty(0, np.intp) if other is None else np.flatnonzero(np.isfinite(other))

    @property
    def mean_of_directions(self) -> "Readings":
        """Mean of both directions, at the points that both have."""
        at, other = self.shared_points, self.y if self.other_direction is None else self.other_direction
        temperature = None if self.temperature is None else self.temperature[at]
        operators = tuple(self.operators[i] for i in at) if self.operators else ()
        mean = (self.y[at] + other[at]) / 2
        return Readings(mean, temperature, operators, scatter_prior=SeriesScatterPrior(self.scatter_prior.common))


RECENT_USE_DAYS = 180.0
"""Days before the last point that define present use, at least two points; chosen."""

STANDSTILL_DAYS = 1e-6
"""Days between two points without use."""


def days_of_use(days: Floats, hours: Floats) -> Floats:
    """Return the days (n,) of the points had the spindle always run as much as lately; the last point stays.

    days: increasing; hours: that it had run (h). The days themselves where hours are missing or go back, or where it
    has not run lately.
    """
    begin = max(min(int(np.searchsorted(days, days[-1] - RECENT_USE_DAYS)), days.size - 2), 0)
    lately = hours[-1] - hours[begin]
    if not np.isfinite(hours).all() or np.any(np.diff(hours) < 0) or lately <= 0:
        return days
    days_an_hour = (days[-1] - days[begin]) / lately
    return np.asarray(days[-1] - (hours[-1] - hours) * days_an_hour - STANDSTILL_DAYS * np.arange(days.size)[::-1])


N_REFERENCE_POINTS = 7
"""Number of earlier points that a point is compared with; chosen."""
MIN_REFERENCE_POINTS = 3
"""Number of earlier points below which no point is an outlier; chosen."""
MAX_OUTLIER_DISTANCE = 3.0
"""Distance (standard deviations) of an outlier from earlier points, to which it is winsorized; chosen."""
CONFIRMED_DISTANCE_SHARE = 0.7
"""Share of its distance at which the next point confirms a point; chosen."""
MAD_TO_STD = 1.4826
"""Standard deviation of normal scatter over its median absolute deviation."""


def winsorize(y: Floats) -> Floats:
    """Clip isolated outliers of a series (n,) to three robust standard deviations.

    What a point becomes follows from those until the one after it, so that the last one is as it was measured.
    """
    values: list[float] = y.tolist()
    steps: list[float] = []
    for i in range(1, len(values) - 1):
        if i >= MIN_REFERENCE_POINTS:
            middle = median(values[max(i - N_REFERENCE_POINTS, 0) : i])
            away, after = values[i] - middle, values[i + 1] - middle
            limit = MAX_OUTLIER_DISTANCE * MAD_TO_STD / sqrt(2) * steps[len(steps) // 2]
            if abs(away) > limit and after / away < CONFIRMED_DISTANCE_SHARE:
                values[i] = middle + copysign(limit, away)
        insort(steps, abs(y[i] - y[i - 1]))
    return np.array(values)


N_GUARDED_POINTS = 3
"""Number of first points that are compared with those after them; chosen, as no earlier points tell whether they are
outliers."""
N_GUARDING_POINTS = 8
"""Number of first points from which the guarded ones are compared with the others; chosen."""
MAX_FIRST_DISTANCE = 4.5
"""Distance of a first point from the others (their standard deviations), up to which it is no outlier; chosen."""
MIN_CLAMPING_ERROR = 2.0
"""Smallest distance (%) of a badly clamped first test; chosen between a drop of 1 % after the first test, which counts,
and a bad clamping of 3 %, which does not."""


def find_first_outliers(y: Floats) -> dict[int, float]:
    """Find which of the first points of a series (n,) no neighbour confirms, and how far each is from the others.

    From eight points on. The first eight decide, so that no later point changes it again.
    """
    first, found = y[:N_GUARDING_POINTS], dict[int, float]()
    for i in range(N_GUARDED_POINTS if y.size >= N_GUARDING_POINTS else 0):
        others = np.delete(first, i)
        middle = np.median(others)
        limit = max(MAX_FIRST_DISTANCE * float(np.std(others, ddof=1)), MIN_CLAMPING_ERROR)
        away, around = first[i] - middle, np.delete(first[: i + 2], i)[-2:] - middle
        if abs(away) > limit and (around / away < CONFIRMED_DISTANCE_SHARE).all():
            found[i] = float(away)
    return found


def guard_first_points(y: Floats) -> Floats:
    """Set each of the first points of a series (n,) that no neighbour confirms to the third point after it.

    The median of the others in its place would make the scatter too small.
    """
    outliers = np.array([*find_first_outliers(y)], dtype=np.intp)
    guarded = y.copy()
    guarded[outliers] = y[outliers + N_GUARDED_POINTS]
    return guarded


MIN_SCATTER_POINTS = 8
"""Number of points from which the scatter of a series is informative; chosen."""
DOF_PER_DIFFERENCE = 0.25
"""Equivalent degrees of freedom of one difference.

A median has 37 % of the efficiency of a sum of squares, and differences two thirds of that of residuals."""
MIN_OTHER_SERIES = 4
"""Smallest number of other series for a scatter prior; chosen."""
MAX_PRIOR_DOF = 30.0
"""Largest equivalent degrees of freedom of a prior from other series; chosen."""


def estimate_scatter(y: Floats) -> ScatterPrior:
    """Estimate the scatter from point to point of a series (n,) by the median of its steps."""
    if y.size < MIN_SCATTER_POINTS:
        return NO_SCATTER_PRIOR
    return ScatterPrior(MAD_TO_STD * float(np.median(np.abs(np.diff(y)))) / 2**0.5, DOF_PER_DIFFERENCE * (y.size - 1))


def pool_scatter(series: Sequence[ScatterPrior]) -> ScatterPrior:
    """Pool the scatters of several series into a prior for another one.

    Empirical Bayes: variances scattered as scaled inverse chi squares; its two parameters by the moments of their
    logarithms (Smyth 2004, "Linear models and empirical Bayes methods", Stat. Appl. Genet. Mol. Biol. 3(1), section
    6.2). Nothing below four series.
    """
    known = np.array([scatter for scatter in series if scatter.freedom and scatter.percent > 0])
    if len(known) < MIN_OTHER_SERIES:
        return NO_SCATTER_PRIOR
    half = known[:, 1] / 2
    logs = 2 * np.log(known[:, 0]) - scipy.special.digamma(half) + np.log(half)
    spread = float(np.var(logs, ddof=1) - scipy.special.polygamma(1, half).mean())
    freedom = MAX_PRIOR_DOF
    if spread > scipy.special.polygamma(1, MAX_PRIOR_DOF / 2):
        freedom = 2 * scipy.optimize.brentq(lambda x: scipy.special.polygamma(1, x) - spread, 1e-3, MAX_PRIOR_DOF / 2)
    variance = np.exp(logs.mean() + scipy.special.digamma(freedom / 2) - np.log(freedom / 2))
    return ScatterPrior(float(np.sqrt(variance)), float(freedom))
