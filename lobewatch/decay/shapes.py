"""The shapes that the course of a series may have, as columns over its dates."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby, repeat
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

RATES = (-4.0, -2.0, -1.0, 1.0, 2.0, 3.0, 4.0, 6.0)
"""Rates of the exponential curves, over the span of the series; chosen."""
POWERS = (1.5, 2.0, 3.0)
"""Exponents of the power curves; chosen."""

Floats = NDArray[np.float64]
Kind = Literal["none", "line", "slope", "step", "curve"]
KINDS: tuple[Kind, ...] = ("none", "line", "slope", "step", "curve")


class Shape(NamedTuple):
    """One shape that the course of a series may have."""

    kind: Kind
    """Kind: "none", steady; "slope", a line from a point on; "step", fallen once; "curve", accelerating or slowing."""
    start: float
    """Date from which on it falls, or on which it fell."""
    accelerates: bool = False
    """Whether a curve accelerates; else it slows down."""
    rate: float = 0.0
    """Rate of an exponential curve, over the span of the series; 0 of others."""
    power: float = 0.0
    """Exponent of a power curve; 0 of others."""


def shapes_of(at: Floats) -> Iterator[Shape]:
    """All shapes that are tried; dates count from the first point on."""
    yield Shape("none", 0.0)
    yield Shape("line", 0.0)
    for kind, starts in (("slope", at[1:-3]), ("step", at[2:-1])):
        yield from map(Shape._make, zip(repeat(kind), starts.tolist(), repeat(False), repeat(0.0), repeat(0.0)))
    yield from (Shape("curve", 0.0, rate > 0, rate=rate) for rate in RATES)
    yield from (Shape("curve", 0.0, True, power=power) for power in POWERS)


def courses(shapes: Sequence[Shape], at: Floats, span: float) -> Floats:
    """Courses of shapes over dates that count from the first point on, shape (j, d); span: of the series."""
    starts = np.array([np.inf if shape.kind == "none" else shape.start for shape in shapes])[:, np.newaxis]
    columns, end = np.empty((len(shapes), at.size)), 0
    for kind, alike in groupby(shape.kind for shape in shapes):
        begin, end = end, end + len([*alike])
        block, block_starts = columns[begin:end], starts[begin:end]
        if kind == "step":
            block[:] = at >= block_starts
        elif kind == "curve":
            curves = [(shape.rate, shape.power) for shape in shapes[begin:end]]
            block[:] = [np.expm1(rate * at / span) if rate else (at / span) ** power for rate, power in curves]
        else:
            np.maximum(np.subtract(at, block_starts, out=block), 0.0, out=block)
    return columns
