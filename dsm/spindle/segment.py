"""Shaft segments and their materials."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TypeVar

import numpy as np

from dsm.arrays import Floats, Indices, require_numbers

SAME_PLACE = 1e-9
"""Largest distance of equal places on the shaft, over its length."""


def nearest_index(positions: Floats, place: float) -> int:
    """Return the index of the position nearest to a place, the first of several."""
    return int(nearest_indices(positions, [place])[0])


def nearest_indices(positions: Floats, places: Sequence[float]) -> Indices:
    """Return the indices of the positions nearest to several places, shape (n,)."""
    return np.asarray(np.abs(np.array(places)[:, np.newaxis] - positions).argmin(axis=1))


FloatOrArray = TypeVar("FloatOrArray", float, Floats)
MATERIAL_UNITS = {"youngs_modulus": "Pa", "density": "kg/m^3", "shear_modulus": "Pa"}


@dataclass(frozen=True)
class Material:
    """Elastic material.

    Raises
    ------
    ValueError
        For constants that no material has.

    Examples
    --------
    >>> steel = Material(youngs_modulus=210e9, density=7850.0, shear_modulus=80.77e9)
    >>> round(steel.poisson_ratio, 2)
    0.3
    >>> Material(youngs_modulus=210e9, density=7850.0, shear_modulus=60e9)
    Traceback (most recent call last):
        ...
    ValueError: shear_modulus=6e+10 Pa and youngs_modulus=2.1e+11 Pa give Poisson's ratio 0.75, ...
    >>> bar = Material(youngs_modulus=120e9, density=1550.0, shear_modulus=5e9, axial_poisson_ratio=0.3)  # carbon fibre
    >>> round(bar.shear_coefficient(0.0), 3)
    0.86
    """

    youngs_modulus: float
    """Young's modulus E along the axis (Pa)."""
    density: float
    """Density rho (kg/m^3)."""
    shear_modulus: float
    """Shear modulus G of planes along the axis (Pa); used by the Timoshenko theory."""
    axial_poisson_ratio: float | None = None
    """Poisson's ratio nu of an orthotropic bar pulled along its axis (-). Default: isotropic, nu = E/2G - 1."""

    def __post_init__(self) -> None:
        """Check the constants."""
        require_numbers("", self, MATERIAL_UNITS, positive=True)
        ratio, slack = self.poisson_ratio, 1e-9
        if -slack <= ratio <= 0.5 + slack:
            return
        if self.axial_poisson_ratio is not None:
            raise ValueError(f"axial_poisson_ratio={ratio:g} is not between 0 and 0.5")
        cure = "For an orthotropic bar, such as carbon fibre, give axial_poisson_ratio too."
        if ratio < 0:
            cure = 'To leave out shear, set theory to "euler-bernoulli" and remove shear_modulus.'
        raise ValueError(
            f"shear_modulus={self.shear_modulus:g} Pa and youngs_modulus={self.youngs_modulus:g} Pa give Poisson's "
            f"ratio {ratio:.3g}, which is not between 0 and 0.5. {cure}"
        )

    @property
    def poisson_ratio(self) -> float:
        """Poisson's ratio nu (-): axial_poisson_ratio, else E/2G - 1."""
        if self.axial_poisson_ratio is None:
            return self.youngs_modulus / (2 * self.shear_modulus) - 1
        return self.axial_poisson_ratio

    @property
    def shear_poisson_ratio(self) -> float:
        """Poisson's ratio of the isotropic bar with the same shear coefficient (-).

        The shear stresses of a bent bar depend on its material by nu G/E only, which is nu/(2 + 2 nu) if isotropic.
        """
        if self.axial_poisson_ratio is None:
            return self.poisson_ratio
        contraction = 2 * self.axial_poisson_ratio * self.shear_modulus
        return contraction / (self.youngs_modulus - contraction)

    def shear_coefficient(self, bore_over_outer: float) -> float:
        """Return the shear coefficient kappa of a ring (-).

        Parameters
        ----------
        bore_over_outer : float
            Bore over outer diameter (-).
        """
        return shear_coefficient(self.shear_poisson_ratio, bore_over_outer)


def shear_coefficient(poisson_ratio: FloatOrArray, bore_over_outer: FloatOrArray) -> FloatOrArray:
    """Return the shear coefficient kappa of a ring (-); bore_over_outer 0 is a full section.

    Source: G. R. Cowper, The shear coefficient in Timoshenko's beam theory, J. Appl. Mech. 33 (1966). For orthotropic
    bars: S. Dharmarajan and H. McCutchen, Shear coefficients for orthotropic beams, J. Compos. Mater. 7 (1973).
    """
    nu, ring = poisson_ratio, (1 + bore_over_outer**2) ** 2
    return 6 * (1 + nu) * ring / ((7 + 6 * nu) * ring + (20 + 12 * nu) * bore_over_outer**2)


def _isotropic_material(youngs_modulus: float, density: float, poisson_ratio: float) -> Material:
    return Material(youngs_modulus, density, youngs_modulus / (2 * (1 + poisson_ratio)))


MATERIALS: Mapping[str, Material] = MappingProxyType(
    {
        "steel": _isotropic_material(210e9, 7850.0, 0.3),
        "stainless steel": _isotropic_material(193e9, 8000.0, 0.29),
        "aluminium": _isotropic_material(70e9, 2700.0, 0.33),
        "titanium": _isotropic_material(114e9, 4430.0, 0.34),
        "brass": _isotropic_material(100e9, 8500.0, 0.34),
        "carbide": _isotropic_material(580e9, 14500.0, 0.22),
        "tungsten alloy": _isotropic_material(340e9, 17600.0, 0.28),
        "carbon fibre": Material(120e9, 1550.0, 5e9, 0.3),
    }
)
"""Handbook values at room temperature by name: AISI 304, Ti-6Al-4V, cemented carbide with 10 % cobalt, 93 % W alloy,
carbon fibres along the axis in epoxy (60 % of the volume)."""

STEEL = MATERIALS["steel"]


@dataclass(frozen=True)
class Segment:
    """Round piece of the shaft, uniform or conical; checked as part of a Spindle.

    Examples
    --------
    >>> Segment(0.3, 0.06, bore_diameter=0.02).second_moment  # m^4; pi (D^4 - d^4) / 64
    6.283185307179585e-07
    >>> cone = Segment(0.1, 0.03, end_outer_diameter=0.05)  # 30 mm towards the tool tip
    >>> cone.diameters_at(0.5)  # m, outer and bore in the middle
    (0.04, 0.0)
    """

    length: float
    """Length along the shaft (m)."""
    outer_diameter: float
    """Outer diameter (m); for a cone at its end towards the tool tip."""
    bore_diameter: float = 0.0
    """Bore diameter (m), 0 if solid; for a cone at its end towards the tool tip."""
    material: Material | None = field(default=None, kw_only=True)
    """Material. Default: that of the spindle."""
    end_outer_diameter: float | None = field(default=None, kw_only=True)
    """Outer diameter at the end away from the tool tip (m); None: no cone outside."""
    end_bore_diameter: float | None = field(default=None, kw_only=True)
    """Bore diameter at the end away from the tool tip (m); None: no cone inside."""
    mass_diameter: float | None = field(default=None, kw_only=True)
    """Outer diameter of the mass (m). Default: outer_diameter, which otherwise counts for the stiffness only.

    Larger than outer_diameter for parts that rotate with the shaft without stiffening it: rotor stack, nut, flutes.
    """

    @property
    def is_cone(self) -> bool:
        """True if a diameter changes along the segment."""
        return self.end_outer_diameter is not None or self.end_bore_diameter is not None

    @property
    def area(self) -> float:
        """Area of the cross-section (m^2); for a cone at its end towards the tool tip."""
        return ring_area(self.outer_diameter, self.bore_diameter)

    @property
    def second_moment(self) -> float:
        """Second moment of area about a diameter (m^4); for a cone at its end towards the tool tip."""
        return ring_second_moment(self.outer_diameter, self.bore_diameter)

    def diameters_at(self, share: float) -> tuple[float, float]:
        """Return outer and bore diameter (m).

        Parameters
        ----------
        share : float
            Share of the length, 0 towards the tool tip (-).
        """
        outer_end = self.outer_diameter if self.end_outer_diameter is None else self.end_outer_diameter
        bore_end = self.bore_diameter if self.end_bore_diameter is None else self.end_bore_diameter
        return (
            self.outer_diameter + share * (outer_end - self.outer_diameter),
            self.bore_diameter + share * (bore_end - self.bore_diameter),
        )

    def check(self, where: str) -> None:
        """Raise ValueError, beginning with `where`, for an invalid segment.

        Parameters
        ----------
        where : str
            Beginning of the message.
        """
        if not (0 < self.length < math.inf and 0 < self.outer_diameter < math.inf):  # spindles are made often
            require_numbers(where, self, {"length": "m", "outer_diameter": "m"}, positive=True)
        _check_bore(where, "", self.bore_diameter, self.outer_diameter)
        if self.end_outer_diameter is not None:
            require_numbers(where, self, {"end_outer_diameter": "m"}, positive=True)
        if self.is_cone:
            outer, bore = self.diameters_at(1.0)
            _check_bore(where, "end_", bore, outer)
        if self.mass_diameter is not None:
            if self.is_cone:
                raise ValueError(f"{where}mass_diameter={self.mass_diameter} m is not supported for a cone")
            require_numbers(where, self, {"mass_diameter": "m"}, positive=True)
            _check_bore(where, "", self.bore_diameter, self.mass_diameter, "mass_diameter")


def ring_area(outer_diameter: FloatOrArray, bore_diameter: FloatOrArray) -> FloatOrArray:
    """Return the area of a ring (m^2), diameters in m."""
    return math.pi * (outer_diameter**2 - bore_diameter**2) / 4


def ring_second_moment(outer_diameter: FloatOrArray, bore_diameter: FloatOrArray) -> FloatOrArray:
    """Return the second moment of area of a ring about a diameter (m^4), diameters in m."""
    return math.pi * (outer_diameter**4 - bore_diameter**4) / 64


def _check_bore(where: str, end: str, bore: float, outer: float, outer_name: str = "") -> None:
    if not 0 <= bore < outer:
        name = outer_name or f"{end}outer_diameter"
        raise ValueError(f"{where}{end}bore_diameter={bore} m is not between 0 and {name}={outer} m")
