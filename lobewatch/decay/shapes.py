"""The shapes that the course of a series may have, as columns over its dates."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

RATES = (-4.0, -2.0, -1.0, 1.0, 2.0, 3.0, 4.0, 6.0)
"""Rates of the exponential curves, over the span of the series; chosen."""
POWERS = (1.5, 2.0, 3.0)
"""Exponents of the power curves; chosen."""
RUNAWAYS = tuple((power, end) for power in (0.5, 1.0) for end in (1.1, 1.2, 1.35, 1.6, 2.0, 2.7))
"""Exponents of the curves that run away, and where they end, in spans of the series from its first point; chosen."""
NEAREST = 1e-6
"""Least share of the way to that end at which such a curve is drawn."""

Floats = NDArray[np.float64]
Kind = Literal["none", "line", "slope", "step", "curve", "runaway", "slopes", "breaks", "crash", "wander", "bend"]
KINDS: tuple[Kind, ...] = (
    "none",
    "line",
    "slope",
    "step",
    "curve",
    "runaway",
    "slopes",
    "breaks",
    "crash",
    "wander",
    "bend",
)


ODDS: dict[Kind, float] = {
    "none": 0.3,
    "step": 0.3,
    "slopes": 5.0,
    "breaks": 5.0,
    "crash": 4.0,
    "wander": 0.5,
    "bend": 0.5,
}
"""How likely kinds are beforehand, all others 1; so chosen that the ranges of many courses hold their dates."""


class Shape(NamedTuple):
    """One shape that the course of a series may have."""

    kind: Kind
    """Kind: "none", steady; "slope", a line from a point on; "step", fallen once; "curve", accelerating or slowing;
    "runaway", to a finite date; "slopes", two, one from each of two dates on; "breaks", a line before them, too;
    "crash", a step and a line; "wander", a line whose level wanders (a Wiener process); "bend", one whose rate does."""
    start: float
    """Date from which on it falls, or on which it fell; the later one of two slopes; the step of a crash."""
    accelerates: bool = False
    """Whether a curve accelerates; else it slows down."""
    rate: float = 0.0
    """Rate of an exponential curve, over the span of the series; how much wanders; 0 of others."""
    power: float = 0.0
    """Exponent of a power curve, or one that runs away; 0 of others."""
    end: float = 0.0
    """Where a curve that runs away ends, in spans; the earlier date of two slopes, that of the line of a crash."""


def shapes_of(at: Floats) -> list[Shape]:
    """All shapes of one column that are tried; dates count from the first point on."""
    return [
        Shape("none", 0.0),
        Shape("line", 0.0),
        *(Shape("slope", start) for start in at[1:-3].tolist()),
        *(Shape("step", start) for start in at[2:-1].tolist()),
        *(Shape("curve", 0.0, rate > 0, rate=rate) for rate in RATES),
        *(Shape("curve", 0.0, True, power=power) for power in POWERS),
        *(Shape("runaway", 0.0, True, power=power, end=end) for power, end in RUNAWAYS),
    ]


def pairs_of(at: Floats) -> list[Shape]:
    """All shapes of two columns that are tried."""
    ramps, steps = [0.0, *at[1:-3].tolist()], at[2:-1].tolist()
    slopes = [Shape("slopes", later, end=ramp) for i, ramp in enumerate(ramps) for later in ramps[i + 1 :]]
    crashes = [Shape("crash", step, end=ramp) for step in steps for ramp in {0.0, step}.intersection(ramps)]
    return slopes + crashes


def triples_of(at: Floats) -> list[Shape]:
    """All shapes of three columns that are tried."""
    ramps = at[1:-3].tolist()
    return [Shape("breaks", later, end=ramp) for i, ramp in enumerate(ramps) for later in ramps[i + 1 :]]


def courses(shapes: Sequence[Shape], at: Floats, span: float) -> Floats:
    """Courses of shapes of one column over dates that count from the first point on, shape (j, 1, d); span: of the
    series."""
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
        elif kind == "runaway":
            ways = [(shape.power, np.maximum(1 - at / (shape.end * span), NEAREST)) for shape in shapes[begin:end]]
            block[:] = [way**-power - 1 for power, way in ways]
        else:
            np.maximum(np.subtract(at, block_starts, out=block), 0.0, out=block)
    return np.asarray(columns[:, np.newaxis])


def pair_courses(shapes: Sequence[Shape], at: Floats) -> Floats:
    """Courses of shapes of two columns, shape (j, 2, d): that of the earlier date, that of the later one."""
    places = np.array([(shape.end, shape.start) for shape in shapes]).reshape(-1, 2, 1)
    columns = np.maximum(at - places, 0.0)
    is_crash = np.array([shape.kind == "crash" for shape in shapes], dtype=bool)
    columns[is_crash, 1] = at >= places[is_crash, 1]
    return np.asarray(columns)


def triple_courses(shapes: Sequence[Shape], at: Floats) -> Floats:
    """Courses of shapes of three columns, shape (j, 3, d): the line, and both dates."""
    line = np.broadcast_to(at, (len(shapes), 1, at.size))
    return np.concatenate([line, pair_courses(shapes, at)], axis=1)
