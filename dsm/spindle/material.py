"""What a segment is made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from dsm.spindle.checks import require_positive

Number = TypeVar("Number", float, NDArray[np.float64])


@dataclass(frozen=True)
class Material:
    """An elastic material. Raises ValueError for constants that no such material has.

    >>> steel = Material(youngs_modulus=210e9, density=7850.0, shear_modulus=80.77e9)
    >>> round(steel.poisson_ratio, 2)
    0.3
    >>> Material(youngs_modulus=210e9, density=7850.0, shear_modulus=60e9)
    Traceback (most recent call last):
        ...
    ValueError: shear_modulus=6e+10 Pa gives Poisson's ratio 0.75 with youngs_modulus=2.1e+11 Pa; it ...
    """

    youngs_modulus: float
    """Young's modulus E (Pa)."""
    density: float
    """Density rho (kg/m^3)."""
    shear_modulus: float
    """Shear modulus G (Pa); used by the Timoshenko theory."""

    def __post_init__(self) -> None:
        """Check the constants; E/2G - 1 is Poisson's ratio."""
        require_positive("", "youngs_modulus", self.youngs_modulus, "Pa")
        require_positive("", "density", self.density, "kg/m^3")
        require_positive("", "shear_modulus", self.shear_modulus, "Pa")
        if not -1 < self.poisson_ratio <= 0.5 * (1 + 1e-9):
            raise ValueError(
                f"shear_modulus={self.shear_modulus:g} Pa gives Poisson's ratio {self.poisson_ratio:.3g} with "
                f"youngs_modulus={self.youngs_modulus:g} Pa; it must lie between -1 and 0.5"
            )

    @property
    def poisson_ratio(self) -> float:
        """Poisson's ratio nu = E/2G - 1 (-)."""
        return self.youngs_modulus / (2 * self.shear_modulus) - 1

    def shear_coefficient(self, bore_over_outer: float) -> float:
        """Share kappa of a ring's area that carries shear (-); see shear_coefficient below."""
        return shear_coefficient(self.poisson_ratio, bore_over_outer)


def shear_coefficient(poisson_ratio: Number, bore_over_outer: Number) -> Number:
    """Share kappa of a ring's area that carries shear (-); 0 is a full section.

    Source: G. R. Cowper, The shear coefficient in Timoshenko's beam theory, J. Appl. Mech. 33 (1966).
    """
    nu, ring = poisson_ratio, (1 + bore_over_outer**2) ** 2
    return 6 * (1 + nu) * ring / ((7 + 6 * nu) * ring + (20 + 12 * nu) * bore_over_outer**2)


def _isotropic(youngs_modulus: float, density: float, poisson_ratio: float) -> Material:
    return Material(youngs_modulus, density, youngs_modulus / (2 * (1 + poisson_ratio)))


MATERIALS: Mapping[str, Material] = MappingProxyType(
    {
        "steel": _isotropic(210e9, 7850.0, 0.3),
        "stainless steel": _isotropic(193e9, 8000.0, 0.29),
        "aluminium": _isotropic(70e9, 2700.0, 0.33),
        "titanium": _isotropic(114e9, 4430.0, 0.34),
        "brass": _isotropic(100e9, 8500.0, 0.34),
        "carbide": _isotropic(580e9, 14500.0, 0.22),
        "tungsten alloy": _isotropic(340e9, 17600.0, 0.28),
    }
)
"""Room-temperature handbook values by name: AISI 304, Ti-6Al-4V, cemented carbide with 10 % cobalt, 93 % W alloy."""

STEEL = MATERIALS["steel"]
