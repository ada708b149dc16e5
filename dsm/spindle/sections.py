"""Uniform pieces of which the shaft is made."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsm.spindle.segment import Segment, ring_area, ring_second_moment
from dsm.spindle.spindle import Spindle

TAPER_ERROR = 1e-4
"""Relative error of a natural frequency from the pieces that stand for cones, at most; see steps_of_cone."""

SAME_DIAMETER = 1e-6
"""Ends of a cone whose outer diameters differ by less than this part count as alike."""
STIFF = [1, 4]
"""Columns of rigidity and shear stiffness in a row of Sections."""

STEEPEST = 0.9
"""No half of a step differs more than by this part from the mean of both: a wall may thin out to nothing."""

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

    def index_at(self, position: _Float) -> NDArray[np.int_]:
        """Index of the piece at each position from the tool tip (m), any shape; 0 is the first."""
        ends = np.cumsum(self.length)
        return np.asarray(np.searchsorted(ends[:-1], position))


def sections(spindle: Spindle) -> Sections:
    """The pieces of a spindle: one for a uniform segment, for a cone as many as TAPER_ERROR asks for."""
    rows = [
        (*piece, index)
        for index, segment in enumerate(spindle.segments)
        for piece in (_cone(spindle, segment) if segment.is_cone else [_piece(spindle, segment, 0.0, segment.length)])
    ]
    length, rigidity, mass, rotary, shear, index_of_segment = np.array(rows).T
    return Sections(length, rigidity, mass, rotary, shear, index_of_segment.astype(int))


def steps_of_cone(segment: Segment, shaft_length: float) -> int:
    """Number of steps, each of two uniform halves, that stand for a cone.

    With c the change of ln(second moment of area), or twice that of ln(area), along the cone, the error falls as
    c/steps^4, and it grows with the share of the cone in the length of the shaft (the waves in it). The factors keep
    the six lowest frequencies of shafts that are one cone of diameters up to 1 : 3, however held, within TAPER_ERROR of
    the exact ones; they were found by comparison.
    """
    ends = [segment.diameters_at(0.0), segment.diameters_at(1.0)]
    inertia, area = ([section(*diameters) for diameters in ends] for section in (ring_second_moment, ring_area))
    outer = [diameters[0] for diameters in ends]
    change = max(p * abs(math.log(b / a)) for p, (a, b) in zip((1, 2, 4), (inertia, area, outer), strict=True))
    waves = max(6.0, 18 * math.sqrt(segment.length / shaft_length))
    return max(1, math.ceil(max(waves * math.pow(change, 0.25), change / 0.6)))


def _cone(spindle: Spindle, segment: Segment) -> list[tuple[float, ...]]:
    """Two uniform halves for each step, with the same mean and first moment of mass and of compliance as the cone.

    Bending moment, shear force and motion run smoothly along a cone, so that the halves change the energy by no more
    than the fourth order of the length of a step. Steps are as much longer as the outer diameter is larger.
    """
    ends = np.linspace(0.0, 1.0, steps_of_cone(segment, spindle.length) + 1)
    growth = segment.diameters_at(1.0)[0] / segment.outer_diameter - 1
    if abs(growth) > SAME_DIAMETER:
        ends = ((1 + growth) ** ends - 1) / growth
    place, weight = np.polynomial.legendre.leggauss(4)
    halves: list[tuple[float, ...]] = []
    for start, end in itertools.pairwise(ends):
        shares = (start + end + (end - start) * place) / 2
        values = np.array([_piece(spindle, segment, float(z), (end - start) / 2 * segment.length) for z in shares])
        values[:, STIFF] **= -1
        mean, moment = weight @ values / 2, (weight * place) @ values
        moment = np.clip(moment, -STEEPEST * mean, STEEPEST * mean)
        for half in (mean - moment, mean + moment):
            half[STIFF] **= -1
            halves.append(tuple(half))
    return halves


def _piece(spindle: Spindle, segment: Segment, share: float, length: float) -> tuple[float, ...]:
    """Row of Sections for the cross-section at a share of the segment's length."""
    outer, bore = segment.diameters_at(share)
    material = segment.material or spindle.material
    heavy = segment.mass_diameter or outer
    return (
        length,
        material.youngs_modulus * ring_second_moment(outer, bore),
        material.density * ring_area(heavy, bore),
        material.density * ring_second_moment(heavy, bore),
        material.shear_coefficient(bore / outer) * material.shear_modulus * ring_area(outer, bore),
    )
