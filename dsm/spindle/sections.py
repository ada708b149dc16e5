"""Cross-sections along a shaft."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsm.spindle.material import shear_coefficient
from dsm.spindle.segment import ring_area, ring_second_moment
from dsm.spindle.spindle import Spindle

_Float = NDArray[np.float64]
_Indices = NDArray[np.int_]


class CrossSection(NamedTuple):
    """What a beam is made of at some places; all of one shape."""

    rigidity: _Float
    """Bending stiffness EI (N m^2)."""
    mass: _Float
    """Mass per length (kg/m)."""
    rotary: _Float
    """Moment of inertia about a diameter per length, rho I (kg m)."""
    shear: _Float
    """Shear stiffness kappa G A (N)."""


@dataclass(frozen=True, eq=False)
class Sections:
    """The segments of a shaft as arrays, from the tool tip on."""

    ends: _Float
    """Where segments begin and end (m), shape (n_segments + 1,)."""
    diameters: _Float
    """Outer at both ends, bore at both ends, outer of the mass at both ends (m), shape (6, n_segments)."""
    material: _Float
    """Young's modulus (Pa), density (kg/m^3), shear modulus (Pa) and Poisson's ratio (-), shape (4, n_segments)."""

    @property
    def is_cone(self) -> NDArray[np.bool_]:
        """Which segments have a diameter that changes, shape (n_segments,)."""
        return np.asarray(np.any(self.diameters[::2] != self.diameters[1::2], axis=0))

    def segment_at(self, position: _Float) -> _Indices:
        """Index of the segment at each position from the tool tip (m), any shape; 0 is the first."""
        return np.asarray(np.searchsorted(self.ends[1:-1], position))

    def at(self, segment: _Indices, position: _Float) -> CrossSection:
        """The cross-sections of segments at positions (m), shapes that go together."""
        start, length = self.ends[segment], self.ends[segment + 1] - self.ends[segment]
        share = (position - start) / length
        first, last = self.diameters[::2, segment], self.diameters[1::2, segment]
        outer, bore, heavy = (near + share * (far - near) for near, far in zip(first, last, strict=True))
        modulus, density, shear_modulus, poisson = self.material[:, segment]
        return CrossSection(
            modulus * ring_second_moment(outer, bore),
            density * ring_area(heavy, bore),
            density * ring_second_moment(heavy, bore),
            shear_coefficient(poisson, bore / outer) * shear_modulus * ring_area(outer, bore),
        )


@lru_cache(maxsize=32)
def sections(spindle: Spindle) -> Sections:
    """The cross-sections of a spindle."""
    rows, common = [], spindle.material
    for segment in spindle.segments:
        (outer, bore), (end_outer, end_bore) = segment.diameters_at(0.0), segment.diameters_at(1.0)
        heavy = (outer, end_outer) if segment.mass_diameter is None else 2 * (segment.mass_diameter,)
        material = segment.material or common
        constants = material.youngs_modulus, material.density, material.shear_modulus, material.poisson_ratio
        rows.append((segment.length, outer, end_outer, bore, end_bore, *heavy, *constants))
    table = np.array(rows).T
    return Sections(np.concatenate([[0.0], np.cumsum(table[0])]), table[1:7], table[7:])
