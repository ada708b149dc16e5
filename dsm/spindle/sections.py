"""Cross-sections along a shaft."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np

from dsm.arrays import Flags, Floats, Indices
from dsm.spindle.segment import Material, Segment, ring_area, ring_second_moment, shear_coefficient
from dsm.spindle.spindle import Spindle


class CrossSection(NamedTuple):
    """Cross-sections of a beam at some places, all arrays of one shape."""

    outer: Floats
    """Outer diameter (m)."""
    bore: Floats
    """Diameter of the bore (m)."""
    mass_outer: Floats
    """Outer diameter of the mass (m)."""
    material: Floats
    """Young's modulus (Pa), density (kg/m^3), shear modulus (Pa) and shear_poisson_ratio (-), shape (4, ...)."""

    @property
    def rigidity(self) -> Floats:
        """Bending stiffness EI (N m^2)."""
        return np.asarray(self.material[0] * ring_second_moment(self.outer, self.bore))

    @property
    def mass(self) -> Floats:
        """Mass per length (kg/m)."""
        return np.asarray(self.material[1] * ring_area(self.mass_outer, self.bore))

    @property
    def rotary(self) -> Floats:
        """Moment of inertia about a diameter per length, rho I (kg m)."""
        return np.asarray(self.material[1] * ring_second_moment(self.mass_outer, self.bore))

    @property
    def shear(self) -> Floats:
        """Shear stiffness kappa G A (N)."""
        coefficient = shear_coefficient(self.material[3], self.bore / self.outer)
        return np.asarray(coefficient * self.material[2] * ring_area(self.outer, self.bore))


@dataclass(frozen=True, eq=False)
class Sections:
    """Segments of a shaft as arrays, from the tool tip on."""

    ends: Floats
    """Ends of the segments (m), shape (n_segments + 1,)."""
    diameters: Floats
    """Outer at both ends, bore at both ends, outer of the mass at both ends (m), shape (6, n_segments)."""
    material: Floats
    """Young's modulus (Pa), density (kg/m^3), shear modulus (Pa) and shear_poisson_ratio (-), shape (4, n_segments)."""

    @cached_property
    def is_cone(self) -> Flags:
        """Which segments are conical, shape (n_segments,)."""
        return np.asarray((self.diameters[::2] != self.diameters[1::2]).any(axis=0))

    def segment_at(self, position: Floats) -> Indices:
        """Return the index of the segment at each position from the tool tip (m), any shape; 0 is the first."""
        return np.asarray(np.searchsorted(self.ends[1:-1], position))

    def at(self, segment: Indices, position: Floats) -> CrossSection:
        """Return the cross-sections of segments at positions (m), in the shape of these."""
        segment = np.broadcast_to(segment, position.shape)
        outer, bore, mass_outer = self.diameters[::2, segment]
        if self.is_cone.any():
            start, length = self.ends[segment], self.ends[segment + 1] - self.ends[segment]
            share = (position - start) / length
            far = self.diameters[1::2, segment]
            outer, bore, mass_outer = (a + share * (b - a) for a, b in zip((outer, bore, mass_outer), far, strict=True))
        return CrossSection(outer, bore, mass_outer, self.material[:, segment])


@lru_cache(maxsize=32)
def sections(spindle: Spindle) -> Sections:
    """Return the cross-sections of a spindle."""
    return sections_of_segments(spindle.segments, spindle.material)


def sections_of_segments(segments: Sequence[Segment], common: Material) -> Sections:
    """Return the cross-sections of segments, some of them of the common material."""
    rows = []
    for segment in segments:
        (outer, bore), (end_outer, end_bore) = segment.diameters_at(0.0), segment.diameters_at(1.0)
        mass_outer = (outer, end_outer) if segment.mass_diameter is None else 2 * (segment.mass_diameter,)
        material = segment.material or common
        constants = material.youngs_modulus, material.density, material.shear_modulus, material.shear_poisson_ratio
        rows.append((segment.length, outer, end_outer, bore, end_bore, *mass_outer, *constants))
    table = np.array(rows).T
    return Sections(np.concatenate([[0.0], np.cumsum(table[0])]), table[1:7], table[7:])
