"""Shapes of a series fitted by least squares: how likely each is, where it goes, and how sure that is."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from lobewatch.decay.series_base import ColumnFits, SeriesBase
from lobewatch.decay.shapes import ODDS, Shape, courses, pair_courses, pairs_of, shapes_of, triple_courses, triples_of

STEP = 1e-6
"""Part of the span over which a rate is taken."""

Floats = NDArray[np.float64]
Drawn = Callable[[Sequence[Shape], Floats], Floats]
"""Columns (j, k, d) of shapes at dates that count from the first point on."""


@dataclass(frozen=True, eq=False)
class Regressions:
    """Shapes of the same number of columns, fitted to one series whose dates count from its first point on."""

    shapes: tuple[Shape, ...]
    """The shapes, j of them."""
    evidence: Floats
    """Logarithm of the evidence for each, a steady series having 0, by Schwarz's approximation, shape (j,)."""
    fits: ColumnFits
    """Their fits."""
    drawn: Drawn
    """Their columns."""
    span: float
    """Length of the series."""

    @property
    def freedom(self) -> Floats:
        """Degrees of freedom, shape (j,)."""
        return np.full(len(self.shapes), float(self.fits.freedom))

    @property
    def variance(self) -> Floats:
        """Variance of a point around each shape, shape (j,)."""
        return self.fits.rss / self.fits.freedom

    def select(self, numbers: NDArray[np.intp]) -> Self:
        """Some of the shapes alone."""
        shapes = tuple(self.shapes[j] for j in numbers)
        return replace(self, shapes=shapes, evidence=self.evidence[numbers], fits=self.fits.select(numbers))

    def at(self, at: Floats) -> tuple[Floats, Floats]:
        """Mean and standard error of each at dates, shape (j, d) each."""
        return self.fits.at(self.drawn(self.shapes, at))

    def rate(self) -> tuple[Floats, Floats]:
        """Rate of change of each at the last point, and its standard error, shape (j,) each."""
        near = self.drawn(self.shapes, np.array([self.span - STEP * self.span, self.span]))
        return self.fits.rate(np.diff(near)[..., 0] / (STEP * self.span))


def single_regressions(base: SeriesBase, at: Floats) -> Regressions:
    """Shapes of one column."""
    span = float(at[-1])
    return _regressions(base, at, shapes_of(at), lambda shapes, dates: courses(shapes, dates, span))


def pair_regressions(base: SeriesBase, at: Floats) -> Regressions:
    """Shapes of two columns."""
    return _regressions(base, at, pairs_of(at), pair_courses)


def triple_regressions(base: SeriesBase, at: Floats) -> Regressions:
    """Shapes of three columns."""
    return _regressions(base, at, triples_of(at), triple_courses)


def _regressions(base: SeriesBase, at: Floats, shapes: Sequence[Shape], drawn: Drawn) -> Regressions:
    """Within a kind equal weight beforehand for each of its shapes."""
    fits = base.fit_columns(drawn(shapes, at))
    counts = Counter(shape.kind for shape in shapes)
    columns = np.array([0 if shape.kind == "none" else fits.size.shape[1] for shape in shapes])
    many = np.log([counts[shape.kind] / ODDS.get(shape.kind, 1.0) for shape in shapes])
    left = np.log(fits.rss / (base.total + np.finfo(float).tiny))
    evidence = -fits.freedom / 2 * left - many - columns / 2 * np.log(at.size)
    return Regressions(tuple(shapes), evidence, fits, drawn, float(at[-1]))
