"""A piece of the shaft."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from dsm.spindle.checks import require_positive
from dsm.spindle.material import Material, Number


@dataclass(frozen=True)
class Segment:
    """A round piece of the shaft, uniform or conical; checked where it becomes part of a Spindle.

    >>> Segment(0.3, 0.06, bore_diameter=0.02).second_moment  # m^4; pi (D^4 - d^4) / 64
    6.283185307179585e-07
    >>> cone = Segment(0.1, 0.03, end_outer_diameter=0.05)  # 30 mm towards the tool tip
    >>> cone.diameters_at(0.5)  # m, outer and bore in the middle
    (0.04, 0.0)
    """

    length: float
    """Length along the shaft (m)."""
    outer_diameter: float
    """Outer diameter (m); of a cone, that of its end towards the tool tip."""
    bore_diameter: float = 0.0
    """Diameter of the bore (m), 0 where solid; of a cone, that of its end towards the tool tip."""
    material: Material | None = field(default=None, kw_only=True)
    """Material; None: that of the spindle."""
    end_outer_diameter: float | None = field(default=None, kw_only=True)
    """Outer diameter of the end away from the tool tip (m); None: no cone outside."""
    end_bore_diameter: float | None = field(default=None, kw_only=True)
    """Diameter of the bore at the end away from the tool tip (m); None: no cone inside."""
    mass_diameter: float | None = field(default=None, kw_only=True)
    """Outer diameter up to which there is mass (m); None: outer_diameter, which counts for the stiffness alone then.

    Larger than outer_diameter where a part turns with the shaft and does not stiffen it: a rotor stack, a nut, flutes.
    """

    @property
    def is_cone(self) -> bool:
        """Whether a diameter changes along the segment."""
        return self.end_outer_diameter is not None or self.end_bore_diameter is not None

    @property
    def area(self) -> float:
        """Area of the cross-section (m^2); of a cone, at its end towards the tool tip."""
        return ring_area(self.outer_diameter, self.bore_diameter)

    @property
    def second_moment(self) -> float:
        """Second moment of area about a diameter (m^4); of a cone, at its end towards the tool tip."""
        return ring_second_moment(self.outer_diameter, self.bore_diameter)

    def diameters_at(self, share: float) -> tuple[float, float]:
        """Outer and bore diameter (m) at a share of the length, 0 towards the tool tip."""
        outer_end = self.outer_diameter if self.end_outer_diameter is None else self.end_outer_diameter
        bore_end = self.bore_diameter if self.end_bore_diameter is None else self.end_bore_diameter
        return (
            self.outer_diameter + share * (outer_end - self.outer_diameter),
            self.bore_diameter + share * (bore_end - self.bore_diameter),
        )

    def check(self, where: str) -> None:
        """Raise ValueError, beginning with `where`, for what is no piece of a shaft."""
        require_positive(where, "length", self.length, "m")
        require_positive(where, "outer_diameter", self.outer_diameter, "m")
        _check_bore(where, "", self.bore_diameter, self.outer_diameter)
        if self.end_outer_diameter is not None:
            require_positive(where, "end_outer_diameter", self.end_outer_diameter, "m")
        if self.is_cone:
            outer, bore = self.diameters_at(1.0)
            _check_bore(where, "end_", bore, outer)
        if self.mass_diameter is not None:
            self._check_mass_diameter(where, self.mass_diameter)

    def _check_mass_diameter(self, where: str, mass_diameter: float) -> None:
        if self.is_cone:
            raise ValueError(f"{where}mass_diameter={mass_diameter} m is for uniform segments; this one is a cone")
        require_positive(where, "mass_diameter", mass_diameter, "m")
        _check_bore(where, "", self.bore_diameter, mass_diameter, "mass_diameter")


def ring_area(outer_diameter: Number, bore_diameter: Number) -> Number:
    """Area of a ring (m^2), diameters in m."""
    return math.pi * (outer_diameter**2 - bore_diameter**2) / 4


def ring_second_moment(outer_diameter: Number, bore_diameter: Number) -> Number:
    """Second moment of area of a ring about a diameter (m^4), diameters in m."""
    return math.pi * (outer_diameter**4 - bore_diameter**4) / 64


def _check_bore(where: str, end: str, bore: float, outer: float, outer_name: str = "") -> None:
    if not 0 <= bore < outer:
        raise ValueError(
            f"{where}{end}bore_diameter={bore} m is not at least 0 and "
            f"smaller than {outer_name or end + 'outer_diameter'}={outer} m"
        )
