"""Fit lines whose level or rate is a random walk.

Generalised least squares with restricted likelihood (Patterson & Thompson 1971); how much wanders is not fitted but
averaged over. The second is the smoothing spline of Wahba (1978).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from lobewatch.arrays import Floats, Indices
from lobewatch.monitoring.level_model import MIN_RESIDUAL_SHARE, LevelModel
from lobewatch.monitoring.trend_shapes import PRIOR_ODDS, ShapeKind, TrendShape

LEVEL_VARIANCES = (0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0)
"""Variances of a level random walk over the span, relative to that of a point; chosen."""
RATE_VARIANCES = (1.0, 10.0, 100.0, 1e3, 1e4)
"""Variances of a rate random walk (levels per span) over the span, relative to that of a point; chosen."""


@dataclass(frozen=True, eq=False)
class RandomWalkFits:
    """Fits of lines of one kind with random walks of different size to one series."""

    shapes: tuple[TrendShape, ...]
    """Lines, j of them; the rate of each is the size of its random walk."""
    evidence: Floats
    """Logarithm of the evidence for each line, relative to a steady series, shape (j,)."""
    variance: Floats
    """Variance of a point around each line, shape (j,)."""
    points: _RotatedPoints
    """Points of the series."""

    @property
    def freedom(self) -> Floats:
        """Degrees of freedom, shape (j,)."""
        return np.full(len(self.shapes), self.points.freedom)

    def select(self, numbers: Indices) -> Self:
        """Select some of the lines."""
        shapes = tuple(self.shapes[j] for j in numbers)
        return replace(self, shapes=shapes, evidence=self.evidence[numbers], variance=self.variance[numbers])

    def predict(self, at: Floats) -> tuple[Floats, Floats]:
        """Predict mean and standard error of each at dates from the first point on, shape (j, d) each."""
        ahead = at / self.points.span
        is_bend = self.points.kind == "bend"
        return self._predict(
            _walk_covariance(is_bend, self.points.share, ahead), _walk_variance(is_bend, ahead), ahead, 1.0
        )

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


@dataclass(frozen=True, eq=False)
class _RotatedPoints:
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

    @property
    def freedom(self) -> float:
        """Degrees of freedom."""
        return float(self.y.size - 2)

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
    evidence, variance = np.empty((2, len(amounts)))
    for j, amount in enumerate(amounts):
        weight = 1 / (1 + amount * points.values)
        gram, _, left = points.solve(weight)
        tiny = np.finfo(float).tiny
        rss = max(float(left), MIN_RESIDUAL_SHARE * base.residual_squares + tiny)
        unsure = (np.log(weight).sum() + np.linalg.slogdet(gram)[1] - np.linalg.slogdet(still)[1]) / 2
        evidence[j] = unsure - points.freedom / 2 * np.log(rss / (base.residual_squares + tiny))
        variance[j] = rss / points.freedom
    evidence += np.log(PRIOR_ODDS[kind]) - np.log(len(amounts)) - np.log(at.size) / 2
    return RandomWalkFits(tuple(TrendShape(kind, 0.0, rate=amount) for amount in amounts), evidence, variance, points)


def _rotate_points(base: LevelModel, at: Floats, kind: ShapeKind) -> _RotatedPoints:
    share, p = at / at[-1], base.columns.shape[1]
    values, vectors = np.linalg.eigh(_walk_covariance(kind == "bend", share, share))
    precision = np.zeros((p + 1, p + 1))
    precision[:p, :p] = base.precision(np.array([at.size]))[0]
    columns = vectors.T @ np.column_stack([base.columns, share])
    return _RotatedPoints(
        kind, share, float(at[-1]), np.maximum(values, 0.0), vectors, columns, vectors.T @ base.y, precision
    )


def _walk_covariance(is_bend: bool, share: Floats, ahead: Floats) -> Floats:
    """Return the covariance of the random walk, its amount being 1, at two sets of shares of the span, shape (n, d)."""
    first = np.minimum(share[:, np.newaxis], ahead)
    return first**3 / 3 + first**2 * np.abs(share[:, np.newaxis] - ahead) / 2 if is_bend else first


def _walk_variance(is_bend: bool, ahead: Floats) -> Floats:
    return ahead**3 / 3 if is_bend else ahead
