"""Regression model of the level of a series, with temperature and operators."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from lobewatch.arrays import Flags, Floats, Indices
from lobewatch.monitoring.series_points import (
    NO_SCATTER_PRIOR,
    Readings,
    ScatterPrior,
    find_first_outliers,
    guard_first_points,
    winsorize,
)

MIN_TEMPERATURE_POINTS = 12
"""Smallest number of points with a temperature to fit its effect; chosen."""
MIN_TEMPERATURE_SPAN = 5.0
"""Smallest range of these temperatures (K); chosen."""
STEEL_FREQUENCY_PER_KELVIN = -0.015
"""Change of the natural frequency with Young's modulus of steel (%/K), and its standard deviation."""

MIN_SCATTER = 1e-3
"""Smallest scatter of a point (%), above rounding; chosen below what any tap test resolves."""
MIN_POINT_VARIANCE = MIN_SCATTER**2
"""Smallest variance of a point (%^2)."""
OPERATOR_SPREAD = 1.0
"""Standard deviation between operators over that from point to point; chosen."""
MIN_SINGULAR_SHARE = 1e-12
"""Singular value over the largest, below which columns are dependent."""


@dataclass(frozen=True, eq=False)
class LevelModel:
    """Series with the columns that every fit contains."""

    y: Floats
    """Values without the expected temperature effect, relative to the first point, shape (n,)."""
    newest: Floats
    """Each value as the newest one of the series, shape (n,)."""
    columns: Floats
    """Columns: 1, the temperature if it counts, and one for each operator, shape (n, p)."""
    n_temperature_columns: int = 0
    """Number of temperature columns."""
    scatter_prior: ScatterPrior = NO_SCATTER_PRIOR
    """Prior scatter from point to point."""
    first_distance: float = 0.0
    """Distance of the first point from the next ones (%) if it is an outlier, else 0."""

    def precision(self, n: Indices) -> Floats:
        """Return the prior precision of the coefficients times the variance of n (r,) points, shape (r, p, p)."""
        p = self.columns.shape[1]
        precision = np.zeros((n.size, p, p))
        for i in range(1 + self.n_temperature_columns, p):
            precision[:, i, i] = OPERATOR_SPREAD**-2
        if self.n_temperature_columns:
            squares = np.concatenate([[0.0, 0.0], np.cumsum(np.diff(self.y) ** 2)])
            variance = np.maximum(squares[n] / (2 * (n - 1)), MIN_POINT_VARIANCE)
            precision[:, 1, 1] = variance / STEEL_FREQUENCY_PER_KELVIN**2
        return precision

    def explained_root(self, kind: str, n: Indices, k: Indices) -> Floats:
        """Return the signed root of the sum of squares that a change from each point k (m,) on explains.

        With the sign of the change; shape (r, m). Without meaning where k leaves no points before or after the
        change. n runs from one number to another, k from 0.
        """
        if self.columns.shape[1] > 1:
            product, square = self._change(kind, n, k)
            with np.errstate(invalid="ignore", divide="ignore"):
                return np.asarray(product / np.sqrt(square))
        length = (n - k).astype(np.float64)
        sums = length if kind == "step" else length * (length - 1) / 2
        product = self._tail(0, kind, n, k)
        product -= sums * self._levels[1][n[:, 0]]
        with np.errstate(invalid="ignore", divide="ignore"):
            product /= np.sqrt(_change_square(kind, n - k) - 1 / n * sums * sums)
        return product

    def freedom(self, n: Indices) -> Floats:
        """Return the degrees of freedom of a change in the first n, shape (r,) each."""
        return np.asarray(n - 2 + self.scatter_prior.freedom, dtype=np.float64)

    def point_variance(self, explained: Floats, n: Indices) -> Floats:
        """Return the variance of a point in the first n, where a change explains this sum of squares, shape (r,)."""
        total, prior = self._residual_squares_up_to[n], self.scatter_prior
        left = np.maximum(total - explained, MIN_POINT_VARIANCE * n)
        return np.asarray((left + prior.freedom * prior.percent**2) / self.freedom(n))

    def fit_change(self, kind: str, n: int, k: int) -> tuple[float, float]:
        """Return size and standard error of a "step" or "slope" (a point) from a point k on in the first n."""
        until = np.array([n])
        product, square = (float(part[0, 0]) for part in self._change(kind, until[:, np.newaxis], np.array([k])))
        size = product / square
        return size, float(np.sqrt(self.point_variance(np.array([size * product]), until)[0] / square))

    def change_sizes(self, fell: Flags, n: Indices, k: Indices) -> Floats:
        """Return the sizes of changes from points k (r,) on in the first n (r,): steps, or slopes a point."""
        sizes = np.empty(n.size)
        for kind, rows in (("step", np.flatnonzero(fell)), ("slope", np.flatnonzero(~fell))):
            if rows.size:
                product, square = self._change(kind, n[rows, np.newaxis], k[rows, np.newaxis])
                sizes[rows] = (product / square)[:, 0]
        return sizes

    def _change(self, kind: str, n: Indices, k: Indices) -> tuple[Floats, Floats]:
        """Return products of the column of a change with the series and with itself, both orthogonal to the model."""
        p = self.columns.shape[1]
        tail, square = [self._tail(i, kind, n, k) for i in range(1 + p)], _change_square(kind, n - k)
        inverse, level = (coefficients[n[:, 0]] for coefficients in self._levels)
        product = tail[0]
        for i in range(p):
            product -= tail[1 + i] * level[:, i, np.newaxis]
            for j in range(p):
                square = square - inverse[:, i, j, np.newaxis] * tail[1 + i] * tail[1 + j]
        return product, square

    def _tail(self, i: int, kind: str, n: Indices, k: Indices) -> Floats:
        """Return the product of the column of a change with the series (0) or one of the columns (from 1 on)."""
        sums, moments = (values[i] for values in self._sums)
        tail: Floats = sums[n] - sums[k]
        if i == 0:
            tail += self._newest_excess[n]
        if kind == "slope":
            tail *= k
            np.subtract(moments[n] - moments[k], tail, out=tail)
            if i == 0:
                tail += self._newest_excess[n] * (n - 1)
        return tail

    @cached_property
    def _newest_excess(self) -> Floats:
        """Difference of the newest value from its final one, by number of points, shape (n + 1,)."""
        return np.concatenate([[0.0], self.newest - self.y])

    @cached_property
    def _levels(self) -> tuple[Floats, Floats]:
        """Inverse normal matrix (n + 1, p, p) and coefficients (n + 1, p) by number of points."""
        n, p = np.arange(2, self.y.size + 1), self.columns.shape[1]
        inverse, level = np.zeros((self.y.size + 1, p, p)), np.zeros((self.y.size + 1, p))
        normal = self._outer[n, 1:, 1:] + self.precision(n)
        inverse[2:] = 1 / normal if p == 1 else np.linalg.inv(normal)
        level[2:] = (inverse[2:] @ self._outer[n, 1:, :1])[..., 0]
        return inverse, level

    @cached_property
    def _residual_squares_up_to(self) -> Floats:
        """Residual sum of squares of the level model by number of points, shape (n + 1,)."""
        return np.asarray(self._outer[:, 0, 0] - (self._outer[:, 0, 1:] * self._levels[1]).sum(axis=1))

    @cached_property
    def _values(self) -> Floats:
        return np.column_stack([self.y, self.columns])

    @cached_property
    def _sums(self) -> tuple[Floats, Floats]:
        """Cumulative sums and moments of the values, shape (1 + p, n + 1) each."""
        moments = np.arange(self.y.size)[:, np.newaxis] * self._values
        return _cumulative_sums(self._values).T, _cumulative_sums(moments).T

    @cached_property
    def _outer(self) -> Floats:
        newest = np.column_stack([self.newest, self.columns])
        past, last = (np.einsum("ni,nj->nij", values, values) for values in (self._values, newest))
        sums = _cumulative_sums(past)
        sums[1:] += last - past
        return sums

    @cached_property
    def inverse_normal_matrix(self) -> Floats:
        """Inverse normal matrix of the level model for unit variance, shape (p, p)."""
        return np.asarray(np.linalg.inv(self.columns.T @ self.columns + self.precision(np.array([self.y.size]))[0]))

    @property
    def residual_squares(self) -> float:
        """Residual sum of squares of the level model for all points, at least that of the smallest scatter."""
        squares = self.y @ (self.y - self.columns @ (self.inverse_normal_matrix @ self.columns.T @ self.y))
        return max(float(squares), MIN_POINT_VARIANCE * self.y.size)

    def fit_columns(self, columns: Floats) -> "ColumnFits":
        """Fit each of some sets of k columns (j, k, n) together with the model."""
        base, crossed = self.inverse_normal_matrix, columns @ self.columns
        level, leaning = base @ self.columns.T @ self.y, crossed @ base
        product = columns @ (self.y - self.columns @ level)
        square = columns @ columns.transpose(0, 2, 1) - leaning @ crossed.transpose(0, 2, 1)
        inverse = np.asarray(np.linalg.pinv(square, rcond=MIN_SINGULAR_SHARE, hermitian=True), dtype=np.float64)
        size = (inverse @ product[..., np.newaxis])[..., 0]
        rss = np.maximum(self.residual_squares - (size * product).sum(axis=1), MIN_POINT_VARIANCE * self.y.size)
        freedom = self.y.size - 1 - columns.shape[1]
        return ColumnFits(rss, size, inverse, leaning[..., 0], float(level[0]), float(base[0, 0]), freedom)


class ColumnFits(NamedTuple):
    """Fits of sets of k columns, one set at a time."""

    rss: Floats
    """Residual sum of squares of each fit, shape (j,)."""
    size: Floats
    """Coefficients of the columns, shape (j, k)."""
    inverse: Floats
    """Inverse of the products of the columns without the level model, shape (j, k, k)."""
    level_leaning: Floats
    """Projections of the columns on the level, shape (j, k)."""
    level: float
    """Level at the mean temperature."""
    level_variance: float
    """Variance of the level for unit variance of a point."""
    freedom: int
    """Degrees of freedom; the temperature costs none, since its effect has a prior."""

    def select(self, numbers: Indices) -> "ColumnFits":
        """Select some of the fits."""
        rss, size, inverse, leaning = (values[numbers] for values in self[:4])
        return ColumnFits(rss, size, inverse, leaning, self.level, self.level_variance, self.freedom)

    def predict(self, columns: Floats) -> tuple[Floats, Floats]:
        """Predict mean and standard error for other values of the columns (j, k, d), shape (j, d) each."""
        away = columns - self.level_leaning[..., np.newaxis]
        mean = self.level + (self.size[:, np.newaxis] @ away)[:, 0]
        variance = self.level_variance + np.einsum("jkd,jkd->jd", self.inverse @ away, away)
        return mean, np.sqrt(variance * (self.rss / self.freedom)[:, np.newaxis])

    def rate(self, slopes: Floats) -> tuple[Floats, Floats]:
        """Return the rate of change and its standard error for slopes of the columns (j, k)."""
        variance = np.einsum("jk,jkl,jl->j", slopes, self.inverse, slopes)
        return (self.size * slopes).sum(axis=1), np.sqrt(variance * self.rss / self.freedom)


def _change_square(kind: str, length: Indices) -> Floats:
    """Return the squared norm of the column of a change over some points."""
    points = length.astype(np.float64)
    return points if kind == "step" else (points - 1) * points * (2 * points - 1) / 6


def _cumulative_sums(values: Floats) -> Floats:
    return np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])


def build_level_model(readings: Readings) -> LevelModel:
    """Build the model of a series, with the temperature only if enough of it is recorded over a wide enough span."""
    rest, columns = readings.y - readings.y[:1].sum(), [np.ones(readings.y.size)]
    temperature = np.full(rest.size, np.nan) if readings.temperature is None else readings.temperature
    recorded = temperature[np.isfinite(temperature)]
    is_warm = recorded.size >= MIN_TEMPERATURE_POINTS and bool(np.ptp(recorded) >= MIN_TEMPERATURE_SPAN)
    if is_warm:
        warmer = temperature - recorded.mean()
        columns.append(np.where(np.isfinite(warmer), warmer, 0.0))
        rest -= STEEL_FREQUENCY_PER_KELVIN * columns[-1]
    names = dict.fromkeys(filter(None, readings.operators))
    columns += [np.array([held == name for held in readings.operators], dtype=np.float64) for name in names]
    away, rest = find_first_outliers(rest).get(0, 0.0), guard_first_points(rest)
    known = readings.scatter_prior.single
    return LevelModel(winsorize(rest), rest, np.column_stack(columns), int(is_warm), known, away)
