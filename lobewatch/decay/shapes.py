"""The shapes that a series may have come about by, as columns over its dates."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby, repeat
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

RATES = (-4.0, -2.0, -1.0, 1.0, 2.0, 3.0, 4.0, 6.0)
"""Of the exponential curves, over the span of the series."""
POWERS = (1.5, 2.0, 3.0)
"""Of the power curves."""

Floats = NDArray[np.float64]
Kind = Literal["none", "line", "slope", "step", "curve"]
KINDS: tuple[Kind, ...] = ("none", "line", "slope", "step", "curve")


class Shape(NamedTuple):
    """One way in which a series may have come about."""

    kind: Kind
    """"none": steady; "slope": a line from a point on; "step": fallen once; "curve": accelerating or slowing down."""
    start: float
    """Date from which on it falls, or on which it fell."""
    accelerates: bool = False
    """Of a curve; else it slows down."""
    rate: float = 0.0
    """Of an exponential curve, over the span of the series; 0 of others."""
    power: float = 0.0
    """Of a power curve; 0 of others."""


def shapes_of(at: Floats) -> Iterator[Shape]:
    """All that are tried; dates count from the first point on."""
    yield Shape("none", 0.0)
    yield Shape("line", 0.0)
    for kind, starts in (("slope", at[1:-3]), ("step", at[2:-1])):
        yield from map(Shape._make, zip(repeat(kind), starts.tolist(), repeat(False), repeat(0.0), repeat(0.0)))
    yield from (Shape("curve", 0.0, rate > 0, rate=rate) for rate in RATES)
    yield from (Shape("curve", 0.0, True, power=power) for power in POWERS)


def courses(shapes: Sequence[Shape], at: Floats, span: float) -> Floats:
    """How shapes run over dates that count from the first point on, shape (j, d); span: of the series."""
    starts = np.array([np.inf if shape.kind == "none" else shape.start for shape in shapes])[:, np.newaxis]
    found, end = np.empty((len(shapes), at.size)), 0
    for kind, alike in groupby(shape.kind for shape in shapes):
        begin, end = end, end + len([*alike])
        own, of_own = found[begin:end], starts[begin:end]
        if kind == "step":
            own[:] = at >= of_own
        elif kind == "curve":
            curved = [(one.rate, one.power) for one in shapes[begin:end]]
            own[:] = [np.expm1(rate * at / span) if rate else (at / span) ** power for rate, power in curved]
        else:
            np.maximum(np.subtract(at, of_own, out=own), 0.0, out=own)
    return found
