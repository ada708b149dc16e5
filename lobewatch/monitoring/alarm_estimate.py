"""Kind, beginning and size of a drop, estimated from all points of its series.

A mixture of shapes, weighted as in a forecast: by the residual sum of squares and the number of shapes of a kind
(Raftery 1995, "Bayesian model selection in social research"). Each shape has at most two dates, at each of which the
level, the rate or both change. A steady series is none of them: the alarm has ruled it out.
"""

from collections.abc import Iterator
from itertools import combinations
from typing import Literal, NamedTuple

import numpy as np

from lobewatch.arrays import Flags, Floats, Indices
from lobewatch.monitoring.forecast import INTERVAL_QUANTILES, average_neighbors, average_readings, mixture_quantile
from lobewatch.monitoring.level_model import LevelModel, build_level_model
from lobewatch.monitoring.series_points import Readings

ChangeKind = Literal["step", "slope", "mixed", "dropped"]
"""Kind of a change: a step, a slope since then, both, or none of these."""


class SeriesChange(NamedTuple):
    """Change of a series, as fitted to its points."""

    kind: ChangeKind
    """Kind of the change; "dropped" where no other kind fits."""
    point: int
    """Index of the first point after the step, or of the last one before the slope, at least 1."""
    size: float
    """Drop from before the change to the last fitted point, in the unit of the series."""
    half_width: float
    """Half the width of the 95 % interval of the size."""


ChangePart = Literal["level", "rate", "both"]
"""Part of a trend that changes at a date: its level, its rate, or both."""


class DropFamily(NamedTuple):
    """Shapes of a drop with the same changes at different dates."""

    kind: ChangeKind
    """Kind of the drop."""
    odds: float
    """Prior odds; chosen so that intervals hold the size and kinds are right."""
    parts: tuple[ChangePart, ...]
    """Part that changes at each date, earliest first."""


DROP_FAMILIES = (
    DropFamily("step", 1.0, ("level",)),
    DropFamily("slope", 1.0, ("rate",)),
    DropFamily("mixed", 0.3, ("both",)),
    DropFamily("mixed", 0.1, ("level", "rate")),
    DropFamily("mixed", 0.1, ("rate", "level")),
    DropFamily("dropped", 0.1, ("level", "level")),
    DropFamily("dropped", 0.3, ("rate", "rate")),
    DropFamily("dropped", 0.1, ("rate", "both")),
)
"""All families of shapes: drops with one date, and with two."""
MIN_POINTS_BEHIND = 2
"""Smallest number of points of a new level, and of points after the first one of a new rate; chosen."""
PURE_KINDS: tuple[ChangeKind, ...] = ("step", "slope")
"""Kinds of a single change."""
MIN_KIND_ODDS = 1.6
"""Smallest weight of the kind of a young drop over that of a pure step or slope; below, it has no kind; chosen so that
at 8 points 9 in 10 steps and slopes have no wrong kind."""
N_YOUNG_POINTS = 12
"""Number of points since the beginning below which a drop is young; chosen."""
NEGLIGIBLE_WEIGHT = 1e-4
"""Weight relative to that of the heaviest shape below which a shape is left out; chosen."""


class _ShapeFits(NamedTuple):
    """Fits of shapes, shape (j,) each."""

    log_weight: Floats
    size: Floats
    error: Floats
    freedom: Floats
    family: Indices
    point: Indices
    accelerates: Flags

    def select_heavy(self) -> "_ShapeFits":
        heavy = self.log_weight - self.log_weight.max() > np.log(NEGLIGIBLE_WEIGHT)
        return _ShapeFits(*(values[heavy] for values in self))


def estimate_drop(readings: Readings) -> SeriesChange:
    """Estimate the drop of a series from all its points.

    Parameters
    ----------
    readings
        Series (%) with an alarm, of five points or more. Many points are averaged with their neighbours.

    Returns
    -------
    SeriesChange
        Kind and beginning of the likeliest shapes. The size is the middle of the 95 % interval of their mixture.
    """
    number = np.arange(readings.y.size, dtype=np.float64)
    days = average_neighbors(number if readings.days is None else readings.days)
    base = build_level_model(average_readings(readings))
    fits = [_fit_family(base, days - days[0], number) for number in range(len(DROP_FAMILIES))]
    fit = _ShapeFits(*(np.concatenate(parts) for parts in zip(*fits, strict=True))).select_heavy()
    weight = np.exp(fit.log_weight - fit.log_weight.max())
    weight /= weight.sum()
    family_weight = np.bincount(fit.family, weight, len(DROP_FAMILIES))
    family = int(np.argmax(family_weight))
    best = int(np.argmax(np.where(fit.family == family, weight, 0.0)))
    low, high = (mixture_quantile(weight, fit.size, fit.error, fit.freedom, p) for p in INTERVAL_QUANTILES)
    first = np.array_split(number, days.size)[fit.point[best]][0]
    kind: ChangeKind = "slope" if fit.accelerates[best] else DROP_FAMILIES[family].kind
    rivals = [i for i, other in enumerate(DROP_FAMILIES) if other.kind in PURE_KINDS and other.kind != kind]
    is_young = days.size - fit.point[best] < N_YOUNG_POINTS
    if is_young and family_weight[family] < MIN_KIND_ODDS * family_weight[rivals].max():
        kind = "dropped"
    return SeriesChange(kind, max(int(first), 1), (low + high) / 2, (high - low) / 2)


def _fit_family(base: LevelModel, days: Floats, family: int) -> _ShapeFits:
    """Fit all shapes of a family to a series at days (n,)."""
    _, odds, parts = DROP_FAMILIES[family]
    places = np.array([*_list_places(parts, days.size)], dtype=np.intp).reshape(-1, len(parts))
    columns = np.concatenate([_build_columns(days, places[:, i], part) for i, part in enumerate(parts)], axis=1)
    fits = base.fit_columns(columns)
    sizes, errors = fits.rate(-columns[:, :, -1])
    many = np.log(len(places) / odds) + columns.shape[1] / 2 * np.log(days.size)
    log_weight = -days.size / 2 * np.log(fits.rss) - many
    freedom, families = np.full(len(places), float(fits.freedom)), np.full(len(places), family)
    accelerates = np.asarray((fits.size < 0).all(axis=1) & (set(parts) == {"rate"}))
    return _ShapeFits(log_weight, sizes, errors, freedom, families, places[:, 0], accelerates)


def _list_places(parts: tuple[ChangePart, ...], n: int) -> Iterator[tuple[int, ...]]:
    """List the points of the dates of a family in n points."""
    begin, end = int(parts[0] != "rate"), n - MIN_POINTS_BEHIND + (parts[-1] == "level")
    return combinations(range(begin, end), len(parts))


def _build_columns(days: Floats, points: Indices, part: ChangePart) -> Floats:
    """Build the columns of a change at points (j,), shape (j, 1, n) or (j, 2, n)."""
    away = days - days[points, np.newaxis]
    level, rate = (np.arange(days.size) >= points[:, np.newaxis]).astype(np.float64), np.maximum(away, 0.0)
    return np.stack({"level": [level], "rate": [rate], "both": [level, rate]}[part], axis=1)
