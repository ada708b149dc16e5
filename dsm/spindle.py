"""The spindle as plain data: uniform round segments on bearing springs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

Theory = Literal["euler-bernoulli"]

SAME_PLACE = 1e-6
"""Places on the shaft nearer to each other than this part of its length count as one."""


@dataclass(frozen=True)
class Segment:
    """A uniform round piece of the shaft; checked where it becomes part of a Spindle."""

    length: float
    """Length along the shaft (m)."""
    outer_diameter: float
    """Outer diameter (m)."""
    bore_diameter: float = 0.0
    """Diameter of the bore (m); 0 where solid."""

    @property
    def area(self) -> float:
        """Area of the cross-section (m^2)."""
        return math.pi * (self.outer_diameter**2 - self.bore_diameter**2) / 4

    @property
    def second_moment(self) -> float:
        """Second moment of area about a diameter (m^4)."""
        return math.pi * (self.outer_diameter**4 - self.bore_diameter**4) / 64


@dataclass(frozen=True)
class Bearing:
    """A radial spring between shaft and housing; checked where it becomes part of a Spindle."""

    position: float
    """Distance from the tool tip (m)."""
    stiffness: float
    """Radial stiffness (N/m)."""


@dataclass(frozen=True)
class Spindle:
    """A spindle with holder and tool: segments from the tool tip (z = 0) on, one material, bearing springs.

    Raises ValueError, naming the segment or bearing (1 is the first), for what is no shaft or does not fit it.
    """

    segments: Sequence[Segment]
    """Segments in order from the tool tip; kept as a tuple."""
    bearings: Sequence[Bearing]
    """Bearings in any order, at segment ends or between them; kept as a tuple. None: a free shaft."""
    youngs_modulus: float = 210e9
    """Young's modulus E (Pa)."""
    density: float = 7850.0
    """Density rho (kg/m^3)."""
    theory: Theory = "euler-bernoulli"
    """Beam theory."""

    def __post_init__(self) -> None:
        """Check numbers and geometry."""
        object.__setattr__(self, "segments", tuple(self.segments))
        object.__setattr__(self, "bearings", tuple(self.bearings))
        if self.theory not in get_args(Theory):
            raise ValueError(f"theory={self.theory!r} is none of {', '.join(get_args(Theory))}")
        if not self.segments:
            raise ValueError("a spindle without segments was given; at least one is needed")
        _check_positive("", "youngs_modulus", self.youngs_modulus, "Pa")
        _check_positive("", "density", self.density, "kg/m^3")
        for number, segment in enumerate(self.segments, 1):
            _check_segment(number, segment)
        for number, bearing in enumerate(self.bearings, 1):
            self._check_bearing(number, bearing)

    @property
    def length(self) -> float:
        """Length of the shaft (m)."""
        return math.fsum(segment.length for segment in self.segments)

    @property
    def mass(self) -> float:
        """Mass of the shaft (kg)."""
        return self.density * math.fsum(segment.area * segment.length for segment in self.segments)

    @property
    def mean_bearing_stiffness(self) -> float:
        """Mean of the bearing stiffnesses (N/m)."""
        require_support(self)
        return math.fsum(bearing.stiffness for bearing in self.bearings) / len(self.bearings)

    def _check_bearing(self, number: int, bearing: Bearing) -> None:
        where, slack = f"bearing {number}: ", SAME_PLACE * self.length
        if not -slack <= bearing.position <= self.length + slack:
            raise ValueError(f"{where}position={bearing.position} m is off the shaft, 0 to {self.length:g} m")
        if bearing.stiffness == math.inf:
            raise ValueError(
                f"{where}stiffness=inf is not finite; natural_frequencies(..., rigid_bearings=True) is the limit"
            )
        _check_positive(where, "stiffness", bearing.stiffness, "N/m")
        for earlier, other in enumerate(self.bearings[: number - 1], 1):
            if abs(other.position - bearing.position) <= slack:
                raise ValueError(
                    f"{where}position={bearing.position} m is that of bearing {earlier}; "
                    "give one bearing with the sum of their stiffness"
                )


def require_support(spindle: Spindle) -> None:
    """Raise ValueError where the shaft can move without bending: with fewer than two bearings."""
    if len(spindle.bearings) < 2:
        raise ValueError(
            f"the shaft is held by {len(spindle.bearings)} bearing(s) and can move freely; at least two are needed"
        )


def _check_segment(number: int, segment: Segment) -> None:
    where = f"segment {number}: "
    _check_positive(where, "length", segment.length, "m")
    _check_positive(where, "outer_diameter", segment.outer_diameter, "m")
    if not 0 <= segment.bore_diameter < segment.outer_diameter:
        raise ValueError(
            f"{where}bore_diameter={segment.bore_diameter} m is not at least 0 and "
            f"smaller than outer_diameter={segment.outer_diameter} m"
        )


def _check_positive(where: str, name: str, value: float, unit: str) -> None:
    if not (math.isfinite(value) and value > 0):
        raise ValueError(f"{where}{name}={value} is not a finite number > 0 ({unit})")
