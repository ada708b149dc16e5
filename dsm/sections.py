"""Uniform pieces of which the shaft is made."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsm.segment import Segment, ring_area, ring_second_moment
from dsm.spindle import Spindle

TAPER_ERROR = 1e-4
"""Bound on the relative error of a natural frequency from the steps that stand for cones; see steps_of_cone."""

_Float = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Sections:
    """Uniform pieces from the tool tip on; all shapes are (n_pieces,)."""

    length: _Float
    """Length (m)."""
    rigidity: _Float
    """Bending stiffness EI (N m^2)."""
    mass: _Float
    """Mass per length (kg/m)."""
    rotary: _Float
    """Moment of inertia about a diameter per length, rho I (kg m)."""
    shear: _Float
    """Shear stiffness kappa G A (N)."""
    segment: NDArray[np.int_]
    """Index of the segment it belongs to, 0 the first."""


def sections(spindle: Spindle) -> Sections:
    """The pieces of a spindle: one for a uniform segment, for a cone as many as TAPER_ERROR asks for."""
    rows: list[tuple[float, ...]] = []
    for index, segment in enumerate(spindle.segments):
        steps = steps_of_cone(segment)
        rows += [(*_piece(spindle, segment, (step + 0.5) / steps, 1 / steps), index) for step in range(steps)]
    table = np.array(rows)
    length, rigidity, mass, rotary, shear, index_of_segment = table.T
    return Sections(length, rigidity, mass, rotary, shear, index_of_segment.astype(int))


def steps_of_cone(segment: Segment) -> int:
    """Number of uniform steps, each with the section at its middle, that stand for a segment; 1 for a uniform one.

    With s = |d ln(d^4)| over one step, the stiffness and mass of a step are off by s^2/24 of their mean and by as much
    again for their slope; the frequency by no more than s^2/12, which is TAPER_ERROR at most.
    """
    if not segment.is_cone:
        return 1
    (outer, bore), (outer_end, bore_end) = segment.diameters_at(0.0), segment.diameters_at(1.0)
    moments = ring_second_moment(outer, bore), ring_second_moment(outer_end, bore_end)
    change = max(abs(math.log(moments[1] / moments[0])), 4 * abs(math.log(outer_end / outer)))
    return max(1, math.ceil(change / math.sqrt(12 * TAPER_ERROR)))


def _piece(spindle: Spindle, segment: Segment, middle: float, share: float) -> tuple[float, ...]:
    outer, bore = segment.diameters_at(middle)
    material = segment.material or spindle.material
    heavy = segment.mass_diameter or outer
    area = ring_area(outer, bore)
    return (
        share * segment.length,
        material.youngs_modulus * ring_second_moment(outer, bore),
        material.density * ring_area(heavy, bore),
        material.density * ring_second_moment(heavy, bore),
        material.shear_coefficient(bore / outer) * material.shear_modulus * area,
    )
