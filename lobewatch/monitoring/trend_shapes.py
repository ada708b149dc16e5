"""Shapes that a trend may have, and their fits: by least squares, and lines whose level or rate is a random walk."""

from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from itertools import groupby
from typing import Literal, NamedTuple, Self, get_args

import numpy as np

from lobewatch.arrays import Floats, Indices
from lobewatch.monitoring.level_model import MIN_RESIDUAL_SHARE, ColumnFits, LevelModel

EXPONENTIAL_RATES = (-4.0, -2.0, -1.0, 1.0, 2.0, 3.0, 4.0, 6.0)
"""Rates of the exponential curves, per span of the series; chosen."""
POWER_EXPONENTS = (1.5, 2.0, 3.0)
"""Exponents of the power curves; chosen."""
RUNAWAY_SHAPES = tuple((power, end) for power in (0.5, 1.0) for end in (1.1, 1.2, 1.35, 1.6, 2.0, 2.7))
"""Exponents of the runaway curves, and their ends in spans of the series from its first point; chosen."""
MIN_RUNAWAY_DISTANCE = 1e-6
"""Smallest remaining share of the time to that end at which such a curve is evaluated."""

ShapeKind = Literal["none", "line", "slope", "step", "curve", "runaway", "slopes", "breaks", "crash", "wander", "bend"]
SHAPE_KINDS: tuple[ShapeKind, ...] = get_args(ShapeKind)


PRIOR_ODDS = {"none": 0.3, "step": 0.3, "slopes": 5.0, "breaks": 5.0, "crash": 4.0, "wander": 0.5, "bend": 0.5}
"""Prior odds of the kinds, all others 1, chosen so that forecast ranges of many trends hold their dates."""


class TrendShape(NamedTuple):
    """Shape that the trend of a series may have."""

    kind: ShapeKind
    """Kind: "none", steady; "slope", a line from a point on; "step", dropped once; "curve", accelerating or slowing;
    "runaway", to a finite date; "slopes", two, one from each of two dates on; "breaks", a line before them, too;
    "crash", a step and a line; "wander", a line whose level wanders (a Wiener process); "bend", one whose rate does."""
    start: float
    """Date of the beginning of the drop, or of the step; the later date of two slopes; the step of a crash."""
    accelerates: bool = False
    """True if a curve accelerates; False if it slows down."""
    rate: float = 0.0
    """Rate of an exponential curve per span, or size of a random walk; else 0."""
    power: float = 0.0
    """Exponent of a power or runaway curve; else 0."""
    end: float = 0.0
    """End of a runaway curve in spans; the earlier date of two slopes; the start of the line of a crash."""


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
    ]


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
        elif kind == "curve":
            share = at / span
            block[:] = [np.expm1(shape.rate * at / span) if shape.rate else share**shape.power for shape in part]
        elif kind == "runaway":
            ways = [np.maximum(1 - at / (shape.end * span), MIN_RUNAWAY_DISTANCE) for shape in part]
            block[:] = [way**-shape.power - 1 for way, shape in zip(ways, part, strict=True)]
        else:
            np.maximum(np.subtract(at, starts[begin:end], out=block), 0.0, out=block)
    return np.asarray(columns[:, np.newaxis])


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
    left = np.log(fits.rss / (base.residual_squares + np.finfo(float).tiny))
    evidence = -fits.freedom / 2 * left - many - columns / 2 * np.log(at.size)
    return ShapeFits(tuple(shapes), evidence, fits, drawn, float(at[-1]), float(fits.freedom))


LEVEL_VARIANCES = (0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0)
"""Variances of a level random walk over the span, relative to that of a point; chosen."""
RATE_VARIANCES = (1.0, 10.0, 100.0, 1e3, 1e4)
"""Variances of a rate random walk (levels per span) over the span, relative to that of a point; chosen."""


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
        ahead = at / self.points.span
        is_bend = self.points.kind == "bend"
        variance = ahead**3 / 3 if is_bend else ahead
        return self._predict(_walk_covariance(is_bend, self.points.share, ahead), variance, ahead, 1.0)

    def rate(self) -> tuple[Floats, Floats]:
        """Return the rate of change of each at the last point and its standard error, shape (j,) each."""
        is_bend, span = self.points.kind == "bend", self.points.span
        crossed = is_bend * self.points.share[:, np.newaxis] ** 2 / 2
        rate, error = self._predict(crossed, np.array([float(is_bend)]), np.ones(1), 0.0)
        return rate[:, 0] / span, error[:, 0] / span

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

    kind: ShapeKind
    """Kind: "wander" or "bend"."""
    share: Floats
    """Elapsed share of the span at each point, shape (n,)."""
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
        """Inverse of the normal matrix (p, p), coefficients (p,) and the sum of squares left, with weights (n,)."""
        weighted = self.columns.T * weight
        gram: Floats = np.asarray(np.linalg.inv(weighted @ self.columns + self.precision), dtype=np.float64)
        line = gram @ weighted @ self.y
        return gram, line, np.asarray(self.y * weight @ (self.y - self.columns @ line))


def fit_random_walks(base: LevelModel, at: Floats, kind: ShapeKind) -> RandomWalkFits:
    """Fit lines whose level ("wander") or rate ("bend") is a random walk; at: dates, shape (n,)."""
    points = _rotate_points(base, at, kind)
    amounts = RATE_VARIANCES if kind == "bend" else LEVEL_VARIANCES
    still, _, _ = points.solve(np.ones(at.size))
    (evidence, variance), freedom = np.empty((2, len(amounts))), float(at.size - 2)
    for j, amount in enumerate(amounts):
        weight = 1 / (1 + amount * points.values)
        gram, _, left = points.solve(weight)
        tiny = np.finfo(float).tiny
        rss = max(float(left), MIN_RESIDUAL_SHARE * base.residual_squares + tiny)
        unsure = (np.log(weight).sum() + np.linalg.slogdet(gram)[1] - np.linalg.slogdet(still)[1]) / 2
        evidence[j] = unsure - freedom / 2 * np.log(rss / (base.residual_squares + tiny))
        variance[j] = rss / freedom
    evidence += np.log(PRIOR_ODDS[kind]) - np.log(len(amounts)) - np.log(at.size) / 2
    shapes = tuple(TrendShape(kind, 0.0, rate=amount) for amount in amounts)
    return RandomWalkFits(shapes, evidence, variance, points, freedom)


def _rotate_points(base: LevelModel, at: Floats, kind: ShapeKind) -> _RotatedPoints:
    share, p = at / at[-1], base.columns.shape[1]
    values, axes = np.linalg.eigh(_walk_covariance(kind == "bend", share, share))
    prior = np.zeros((p + 1, p + 1))
    prior[:p, :p] = base.precision(np.array([at.size]))[0]
    columns = axes.T @ np.column_stack([base.columns, share])
    variances, y, span = np.maximum(values, 0.0), axes.T @ base.y, float(at[-1])
    return _RotatedPoints(kind, share, span, variances, axes, columns, y, prior)


def _walk_covariance(is_bend: bool, share: Floats, ahead: Floats) -> Floats:
    """Return the covariance of the random walk, its amount being 1, at two sets of shares of the span, shape (n, d)."""
    first = np.minimum(share[:, np.newaxis], ahead)
    return first**3 / 3 + first**2 * np.abs(share[:, np.newaxis] - ahead) / 2 if is_bend else first


FitFamily = ShapeFits | RandomWalkFits
"""Fits of one sort of shapes to a series."""
