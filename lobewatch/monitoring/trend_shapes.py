"""Shapes that a trend may have, and their fits: by least squares, and lines whose level or rate is a random walk."""

from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from itertools import groupby
from typing import Literal, NamedTuple, Self, get_args

import numpy as np

from lobewatch.arrays import Floats, Indices
from lobewatch.monitoring.level_model import MIN_POINT_VARIANCE, ColumnFits, LevelModel

EXPONENTIAL_RATES = (-4.0, -2.0, -1.0, 1.0, 2.0, 3.0, 4.0, 6.0)
"""Rates of the exponential curves, per span of the series; chosen."""
POWER_EXPONENTS = (1.5, 2.0, 3.0)
"""Exponents of the power curves; chosen."""
RUNAWAY_SHAPES = tuple((power, end) for power in (0.5, 1.0) for end in (1.1, 1.2, 1.35, 1.6, 2.0, 2.7))
"""Exponents of the runaway curves, and their ends in spans of the series from its first point; chosen."""
MIN_RUNAWAY_DISTANCE = 1e-6
"""Smallest remaining share of the time to that end at which such a curve is evaluated."""

LATE_EXPONENTIAL_RATES = (2.0, 4.0)
"""Rates of the exponential curves that begin at a later point, per time from there to the last point; chosen."""
LATE_POWER_EXPONENTS = (2.0, 3.0)
"""Exponents of the power curves that begin at a later point; chosen."""
LATE_RUNAWAY_SHAPES = tuple((power, end) for power in (0.5, 1.0) for end in (1.2, 1.6, 2.5))
"""Exponents of the runaway curves that begin at a later point, and their ends in times from there to the last point;
chosen."""
MIN_LATE_POINTS = 5
"""Smallest number of points after the one at which a curve or random walk begins; chosen."""
N_LATE_WALKS = 12
"""Largest number of points at which random walks begin, for speed; chosen."""
MAX_EXPONENT = 50.0
"""Exponent at which an exponential curve is far beyond any level."""

ShapeKind = Literal[
    "none", "line", "slope", "step", "curve", "runaway", "slopes", "breaks", "crash", "wander", "bend",
    "late curve", "late runaway", "late wander", "late bend",
]  # fmt: skip
SHAPE_KINDS: tuple[ShapeKind, ...] = get_args(ShapeKind)


PRIOR_ODDS = {
    "none": 0.5,
    "step": 0.3,
    "slopes": 5.0,
    "breaks": 5.0,
    "crash": 4.0,
    "wander": 0.5,
    "bend": 0.5,
    "late runaway": 0.5,
    "late wander": 6.0,
    "late bend": 3.0,
}
"""Prior odds of the kinds, all others 1, chosen so that forecast ranges of many trends hold their dates.

Within a kind, each beginning has the same prior weight, and so has each form of a curve and each size of a random walk.
"""


class TrendShape(NamedTuple):
    """Shape that the trend of a series may have."""

    kind: ShapeKind
    """Kind: "none", steady; "slope", a line from a point on; "step", dropped once; "curve", accelerating or slowing;
    "runaway", to a finite date; "slopes", two, one from each of two dates on; "breaks", a line before them, too;
    "crash", a step and a line; "wander", a line whose level wanders (a Wiener process); "bend", one whose rate does;
    "late" curves and random walks, steady up to a point and accelerating or wandering from there on."""
    start: float
    """Date of the beginning of the drop, or of the step; the later date of two slopes; the step of a crash."""
    accelerates: bool = False
    """True if a curve accelerates; False if it slows down."""
    rate: float = 0.0
    """Rate of an exponential curve per time from its start to the last point, or size of a random walk; else 0."""
    power: float = 0.0
    """Exponent of a power or runaway curve; else 0."""
    end: float = 0.0
    """End of a runaway curve in times from its start to the last point; the earlier date of two slopes; the start of
    the line of a crash."""


def list_single_shapes(at: Floats) -> list[TrendShape]:
    """List all shapes of one column; dates count from the first point on."""
    return [
        TrendShape("none", 0.0),
        TrendShape("line", 0.0),
        *(TrendShape("slope", start) for start in at[1:-3].tolist()),
        *(TrendShape("step", start) for start in at[2:-1].tolist()),
        *(TrendShape("curve", 0.0, rate > 0, rate=rate) for rate in EXPONENTIAL_RATES),
        *(TrendShape("curve", 0.0, True, power=power) for power in POWER_EXPONENTS),
        *(TrendShape("runaway", 0.0, True, power=power, end=end) for power, end in RUNAWAY_SHAPES),
        *_list_late_curves(at),
    ]


def _list_late_curves(at: Floats) -> list[TrendShape]:
    """List the accelerating curves that begin at each later point."""
    begins = _late_starts(at)
    return [
        *(TrendShape("late curve", start, True, rate=rate) for start in begins for rate in LATE_EXPONENTIAL_RATES),
        *(TrendShape("late curve", start, True, power=power) for start in begins for power in LATE_POWER_EXPONENTS),
        *(
            TrendShape("late runaway", start, True, power=power, end=end)
            for start in begins
            for power, end in LATE_RUNAWAY_SHAPES
        ),
    ]


def _late_starts(at: Floats) -> list[float]:
    """List the dates at which a curve or random walk may begin, apart from the first."""
    return [start for start in at[1:-MIN_LATE_POINTS].tolist() if start < at[-1]]


def list_pair_shapes(at: Floats) -> list[TrendShape]:
    """List all shapes of two columns."""
    ramps, steps = [0.0, *at[1:-3].tolist()], at[2:-1].tolist()
    slopes = [TrendShape("slopes", later, end=ramp) for i, ramp in enumerate(ramps) for later in ramps[i + 1 :]]
    return slopes + [TrendShape("crash", step, end=ramp) for step in steps for ramp in {0.0, step}.intersection(ramps)]


def list_triple_shapes(at: Floats) -> list[TrendShape]:
    """List all shapes of three columns."""
    ramps = at[1:-3].tolist()
    return [TrendShape("breaks", later, end=ramp) for i, ramp in enumerate(ramps) for later in ramps[i + 1 :]]


def build_columns(shapes: Sequence[TrendShape], at: Floats, span: float) -> Floats:
    """Build the columns of one-column shapes at dates from the first point on, shape (j, 1, d)."""
    starts = np.array([np.inf if shape.kind == "none" else shape.start for shape in shapes])[:, np.newaxis]
    columns, end = np.empty((len(shapes), at.size)), 0
    for kind, alike in groupby(shape.kind for shape in shapes):
        begin, end = end, end + len([*alike])
        block, part = columns[begin:end], shapes[begin:end]
        if kind == "step":
            block[:] = at >= starts[begin:end]
        elif kind.endswith(("curve", "runaway")):
            block[:] = _build_curves(part, np.maximum(at - starts[begin:end], 0.0) / (span - starts[begin:end]))
        else:
            np.maximum(np.subtract(at, starts[begin:end], out=block), 0.0, out=block)
    return np.asarray(columns[:, np.newaxis])


def _build_curves(shapes: Sequence[TrendShape], share: Floats) -> Floats:
    """Build curves over the share of the time from the start of each to the last point, shape (j, d)."""
    rate, power, end = np.array([(shape.rate, shape.power, shape.end) for shape in shapes]).T[..., np.newaxis]
    if end.any():
        return np.asarray(np.maximum(1 - share / end, MIN_RUNAWAY_DISTANCE) ** -power - 1)
    grows = rate[:, 0] != 0
    curves = share**power
    curves[grows] = np.expm1(np.minimum(rate[grows] * share[grows], MAX_EXPONENT))
    return np.asarray(curves)


def build_pair_columns(shapes: Sequence[TrendShape], at: Floats) -> Floats:
    """Build the columns of two-column shapes, shape (j, 2, d): the earlier date, the later one."""
    places = np.array([(shape.end, shape.start) for shape in shapes]).reshape(-1, 2, 1)
    columns = np.maximum(at - places, 0.0)
    is_crash = np.array([shape.kind == "crash" for shape in shapes], dtype=bool)
    columns[is_crash, 1] = at >= places[is_crash, 1]
    return np.asarray(columns)


def build_triple_columns(shapes: Sequence[TrendShape], at: Floats) -> Floats:
    """Build the columns of three-column shapes, shape (j, 3, d): the line, and both dates."""
    return np.concatenate([np.broadcast_to(at, (len(shapes), 1, at.size)), build_pair_columns(shapes, at)], axis=1)


RATE_STEP = 1e-6
"""Share of the span over which a rate is computed."""

ColumnBuilder = Callable[[Sequence[TrendShape], Floats], Floats]
"""Function that returns the columns (j, k, d) of shapes at dates from the first point on."""


class ShapeFits(NamedTuple):
    """Fits of shapes with equal numbers of columns to one series, with dates from its first point on."""

    shapes: tuple[TrendShape, ...]
    """Fitted shapes, j of them."""
    evidence: Floats
    """Logarithm of the evidence for each, relative to a steady series, by Schwarz's approximation, shape (j,)."""
    fits: ColumnFits
    """Fits of their columns."""
    build_columns: ColumnBuilder
    """Builder of their columns."""
    span: float
    """Span of the series."""
    freedom: float
    """Degrees of freedom of each."""

    @property
    def variance(self) -> Floats:
        """Variance of a point around each shape, shape (j,)."""
        return self.fits.rss / self.fits.freedom

    def select(self, numbers: Indices) -> Self:
        """Select some of the shapes."""
        shapes = tuple(self.shapes[j] for j in numbers)
        return self._replace(shapes=shapes, evidence=self.evidence[numbers], fits=self.fits.select(numbers))

    def predict(self, at: Floats) -> tuple[Floats, Floats]:
        """Predict mean and standard error of each at dates, shape (j, d) each."""
        return self.fits.predict(self.build_columns(self.shapes, at))

    def rate(self) -> tuple[Floats, Floats]:
        """Return the rate of change of each at the last point and its standard error, shape (j,) each."""
        near = self.build_columns(self.shapes, np.array([self.span - RATE_STEP * self.span, self.span]))
        return self.fits.rate(np.diff(near)[..., 0] / (RATE_STEP * self.span))


def fit_shapes(base: LevelModel, at: Floats) -> list[ShapeFits]:
    """Fit the shapes of one, two and three columns."""
    single = _fit_shapes(base, at, list_single_shapes(at), partial(build_columns, span=float(at[-1])))
    pairs = _fit_shapes(base, at, list_pair_shapes(at), build_pair_columns)
    return [single, pairs, _fit_shapes(base, at, list_triple_shapes(at), build_triple_columns)]


def _fit_shapes(base: LevelModel, at: Floats, shapes: Sequence[TrendShape], drawn: ColumnBuilder) -> ShapeFits:
    """Fit shapes; within a kind each has the same prior weight."""
    fits = base.fit_columns(drawn(shapes, at))
    counts = Counter(shape.kind for shape in shapes)
    columns = np.array([0 if shape.kind == "none" else fits.size.shape[1] for shape in shapes])
    many = np.log([counts[shape.kind] / PRIOR_ODDS.get(shape.kind, 1.0) for shape in shapes])
    left = np.log(fits.rss / base.residual_squares)
    evidence = -fits.freedom / 2 * left - many - columns / 2 * np.log(at.size)
    return ShapeFits(tuple(shapes), evidence, fits, drawn, float(at[-1]), float(fits.freedom))


LEVEL_VARIANCES = (0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0)
"""Variances of a level random walk over the span, relative to that of a point; chosen."""
RATE_VARIANCES = (1.0, 10.0, 100.0, 1e3, 1e4)
"""Variances of a rate random walk (levels per span) over the span, relative to that of a point; chosen."""
LATE_LEVEL_VARIANCES = (100.0, 1e3, 1e4, 1e5)
"""Variances of a level random walk that begins at a later point, larger than from the first point on; chosen."""
LATE_RATE_VARIANCES = (1e4, 1e5, 1e6, 1e7)
"""Variances of a rate random walk that begins at a later point; chosen."""


class RandomWalkFits(NamedTuple):
    """Fits of lines of one kind with random walks of different size to one series."""

    shapes: tuple[TrendShape, ...]
    """Lines, j of them; the rate of each is the size of its random walk."""
    evidence: Floats
    """Logarithm of the evidence for each line, relative to a steady series, shape (j,)."""
    variance: Floats
    """Variance of a point around each line, shape (j,)."""
    points: "_RotatedPoints"
    """Points of the series."""
    freedom: float
    """Degrees of freedom of each."""

    def select(self, numbers: Indices) -> Self:
        """Select some of the lines."""
        shapes = tuple(self.shapes[j] for j in numbers)
        return self._replace(shapes=shapes, evidence=self.evidence[numbers], variance=self.variance[numbers])

    def predict(self, at: Floats) -> tuple[Floats, Floats]:
        """Predict mean and standard error of each at dates from the first point on, shape (j, d) each."""
        points = self.points
        ahead = np.maximum(at / points.span - points.start, 0.0)
        variance = ahead**3 / 3 if points.is_bend else ahead
        return self._predict(_walk_covariance(points.is_bend, points.share, ahead), variance, ahead, 1.0)

    def rate(self) -> tuple[Floats, Floats]:
        """Return the rate of change of each at the last point and its standard error, shape (j,) each."""
        points = self.points
        crossed = points.is_bend * points.share[:, np.newaxis] ** 2 / 2
        rate, error = self._predict(crossed, points.is_bend * points.share[-1:], np.ones(1), 0.0)
        return rate[:, 0] / points.span, error[:, 0] / points.span

    def _predict(self, crossed: Floats, variance: Floats, slope: Floats, level: float) -> tuple[Floats, Floats]:
        """Best linear predictions of level + slope (d,) of the line and what wanders, shape (j, d) each.

        crossed: covariance of what wanders with the points (n, d); variance: its own (d,).
        """
        points, means, errors = self.points, list[Floats](), list[Floats]()
        wanted = np.zeros((slope.size, points.columns.shape[1]))
        wanted[:, 0], wanted[:, -1] = level, slope
        turned = points.vectors.T @ crossed
        for shape, point in zip(self.shapes, self.variance, strict=True):
            weight = 1 / (1 + shape.rate * points.values)
            gram, line, _ = points.solve(weight)
            lever = shape.rate * turned * weight[:, np.newaxis]
            means.append(wanted @ line + lever.T @ (points.y - points.columns @ line))
            away = wanted - lever.T @ points.columns
            unknown = shape.rate * (variance - np.einsum("nd,nd->d", turned, lever))
            errors.append(np.sqrt(point * np.maximum(unknown + np.einsum("dp,pq,dq->d", away, gram, away), 0.0)))
        return np.array(means), np.array(errors)


class _RotatedPoints(NamedTuple):
    """Series rotated into the directions in which the random walk is independent."""

    is_bend: bool
    """True if the rate is the random walk; False if the level is."""
    start: float
    """Start of the line and of the random walk, as a share of the span."""
    share: Floats
    """Share of the span from there to each point, shape (n,)."""
    span: float
    """Span of the series."""
    values: Floats
    """Variance of a unit random walk in each direction, shape (n,)."""
    vectors: Floats
    """Directions, shape (n, n)."""
    columns: Floats
    """Rotated columns of level model and line, shape (n, p)."""
    y: Floats
    """Rotated values, shape (n,)."""
    precision: Floats
    """Prior precision of the coefficients, shape (p, p)."""

    def solve(self, weight: Floats) -> tuple[Floats, Floats, Floats]:
        """Inverse of the normal matrix, coefficients and the sum of squares left, with weights (..., n).

        Shapes (..., p, p), (..., p) and (...).
        """
        weighted = self.columns.T * weight[..., np.newaxis, :]
        gram: Floats = np.asarray(np.linalg.inv(weighted @ self.columns + self.precision), dtype=np.float64)
        line = (gram @ (weighted @ self.y)[..., np.newaxis])[..., 0]
        return gram, line, np.asarray((self.y * weight * (self.y - line @ self.columns.T)).sum(axis=-1))


def fit_random_walks(base: LevelModel, at: Floats) -> list[RandomWalkFits]:
    """Fit lines whose level or rate is a random walk, from the first point on and from later ones; at: dates (n,)."""
    late = _late_starts(at)
    starts = (
        [late[i] for i in sorted({*np.linspace(0, len(late) - 1, N_LATE_WALKS).astype(int).tolist()})] if late else []
    )
    kinds: dict[ShapeKind, tuple[tuple[float, ...], list[float]]] = {
        "wander": (LEVEL_VARIANCES, [0.0]),
        "bend": (RATE_VARIANCES, [0.0]),
        "late wander": (LATE_LEVEL_VARIANCES, starts),
        "late bend": (LATE_RATE_VARIANCES, starts),
    }
    return [
        _fit_random_walk(base, at, [TrendShape(kind, start, rate=amount) for amount in amounts], len(begins))
        for kind, (amounts, begins) in kinds.items()
        for start in begins
    ]


def _fit_random_walk(base: LevelModel, at: Floats, shapes: Sequence[TrendShape], n_starts: int) -> RandomWalkFits:
    """Fit random walks of one kind and one of its starts."""
    points, freedom = _rotate_points(base, at, shapes[0]), float(at.size - 2)
    amounts = np.array([[shape.rate] for shape in shapes])
    weight = 1 / (1 + np.concatenate([[[0.0]], amounts]) * points.values)
    gram, _, left = points.solve(weight)
    rss = np.maximum(left[1:], MIN_POINT_VARIANCE * at.size)
    known = np.log(weight).sum(axis=1) + np.linalg.slogdet(gram)[1]
    evidence = (known[1:] - known[0]) / 2 - freedom / 2 * np.log(rss / base.residual_squares)
    evidence += np.log(PRIOR_ODDS[shapes[0].kind] / (len(shapes) * n_starts)) - np.log(at.size) / 2
    return RandomWalkFits(tuple(shapes), evidence, rss / freedom, points, freedom)


def _rotate_points(base: LevelModel, at: Floats, shape: TrendShape) -> _RotatedPoints:
    """Rotate the points after the start of a shape; those before stay as they are."""
    span, p, is_bend = float(at[-1]), base.columns.shape[1], shape.kind.endswith("bend")
    share = np.maximum((at - shape.start) / span, 0.0)
    later = np.flatnonzero(share)
    variances, axes = np.zeros(at.size), np.eye(at.size)
    values, axes[np.ix_(later, later)] = np.linalg.eigh(_walk_covariance(is_bend, share[later], share[later]))
    variances[later] = np.maximum(values, 0.0)
    prior = np.zeros((p + 1, p + 1))
    prior[:p, :p] = base.precision(np.array([at.size]))[0]
    columns = axes.T @ np.column_stack([base.columns, share])
    return _RotatedPoints(is_bend, shape.start / span, share, span, variances, axes, columns, axes.T @ base.y, prior)


def _walk_covariance(is_bend: bool, share: Floats, ahead: Floats) -> Floats:
    """Return the covariance of the random walk, its amount being 1, at two sets of shares of the span, shape (n, d)."""
    first = np.minimum(share[:, np.newaxis], ahead)
    return first**3 / 3 + first**2 * np.abs(share[:, np.newaxis] - ahead) / 2 if is_bend else first


FitFamily = ShapeFits | RandomWalkFits
"""Fits of one sort of shapes to a series."""
