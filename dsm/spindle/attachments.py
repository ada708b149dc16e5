"""What a shaft is held by, carries and is joined with."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal, TypeVar, get_args

import numpy as np
from numpy.typing import NDArray

from dsm.spindle.checks import require_not_negative, require_positive

Stiffness = TypeVar("Stiffness", float, NDArray[np.complex128])
RollingElements = Literal["balls", "rollers"]


def shaft_share(stiffness: Stiffness, softness: Stiffness) -> Stiffness:
    """Part of the motion of the shaft that goes into a bearing of a stiffness (N/m), not into its housing (m/N)."""
    return 1 / (1 + stiffness * softness)


@dataclass(frozen=True)
class Bearing:
    """A radial spring, with or without damper, between shaft and housing; checked as part of a Spindle.

    >>> bearing = Bearing(position=0.15, stiffness=2e8, housing_stiffness=2e8)
    >>> bearing.support_stiffness / 1e6  # N/um: two equal springs in series
    100.0
    """

    position: float
    """Distance from the tool tip (m)."""
    stiffness: float
    """Radial stiffness (N/m); inf holds the shaft (in series with the housing, where that has a stiffness)."""
    damping: float = field(default=0.0, kw_only=True)
    """Viscous damping beside the spring (N s/m)."""
    rotational_stiffness: float = field(default=0.0, kw_only=True)
    """Stiffness against tilting (N m/rad)."""
    housing_stiffness: float = field(default=math.inf, kw_only=True)
    """Radial stiffness of the housing behind the bearing, in series with it (N/m); inf: rigid."""
    group: str = field(default="bearings", kw_only=True)
    """Bearings of one group are calibrated together, in their given ratio; an empty name: known, never calibrated."""

    rolling_elements: RollingElements = field(default="balls", kw_only=True)
    """Kind of rolling elements; of balls, the stiffness says in which range the preload left lies."""

    @property
    def support_stiffness(self) -> float:
        """What the shaft feels of bearing and housing (N/m)."""
        if math.isinf(self.stiffness):
            return self.housing_stiffness
        return self.stiffness * shaft_share(self.stiffness, 1 / self.housing_stiffness)

    def check(self, where: str) -> None:
        """Raise ValueError, beginning with `where`, for what is no bearing."""
        require_positive(where, "stiffness", self.stiffness, "N/m", infinite=True)
        require_not_negative(where, "damping", self.damping, "N s/m")
        if self.rolling_elements not in get_args(RollingElements):
            known = ", ".join(get_args(RollingElements))
            raise ValueError(f"{where}rolling_elements={self.rolling_elements!r} is none of {known}")
        require_not_negative(where, "rotational_stiffness", self.rotational_stiffness, "N m/rad")
        require_positive(where, "housing_stiffness", self.housing_stiffness, "N/m", infinite=True)


@dataclass(frozen=True)
class LumpedMass:
    """A rigid body on the shaft, a pulley or a balance ring; checked as part of a Spindle.

    >>> pulley = LumpedMass(position=0.25, mass=3.0)  # kg, in the middle of the shaft
    >>> ends = [Bearing(0.0, np.inf), Bearing(0.5, np.inf)]
    >>> bare, laden = (Spindle([Segment(0.5, 0.05)], ends, masses=masses) for masses in ((), (pulley,)))
    >>> [round(natural_frequencies(spindle, 1)[0]) for spindle in (bare, laden)]  # Hz
    [406, 304]
    """

    position: float
    """Distance of its centre from the tool tip (m)."""
    mass: float
    """Mass (kg)."""
    diametral_inertia: float = 0.0
    """Moment of inertia about a diameter (kg m^2)."""
    polar_inertia: float = 0.0
    """Moment of inertia about the shaft's axis (kg m^2); makes frequencies depend on speed."""

    def check(self, where: str) -> None:
        """Raise ValueError, beginning with `where`, for what is no rigid body."""
        require_not_negative(where, "mass", self.mass, "kg")
        require_not_negative(where, "diametral_inertia", self.diametral_inertia, "kg m^2")
        require_not_negative(where, "polar_inertia", self.polar_inertia, "kg m^2")
        if self.polar_inertia > 2 * self.diametral_inertia * (1 + 1e-9):
            raise ValueError(
                f"{where}polar_inertia={self.polar_inertia} kg m^2 is larger than twice diametral_inertia="
                f"{self.diametral_inertia} kg m^2, which no body of revolution has"
            )


@dataclass(frozen=True)
class Joint:
    """A compliant joint across the shaft: tool in holder, holder in spindle; checked as part of a Spindle.

    >>> holder = Joint(position=0.1, stiffness=1e9, rotational_stiffness=5e5)  # N/m, N m/rad
    >>> shaft = Spindle([Segment(0.4, 0.05)], [Bearing(0.2, 2e8), Bearing(0.35, 1e8)])
    >>> jointed = Spindle(shaft.segments, shaft.bearings, joints=[holder])
    >>> [round(natural_frequencies(spindle, 1)[0]) for spindle in (shaft, jointed)]  # Hz
    [449, 434]
    """

    position: float
    """Distance from the tool tip (m)."""
    stiffness: float
    """Radial stiffness between its two sides (N/m)."""
    rotational_stiffness: float
    """Stiffness against tilting between its two sides (N m/rad)."""
    group: str = field(default="", kw_only=True)
    """Name under which its two stiffnesses are calibrated together; empty: known, never calibrated."""
    rotational_group: str = field(default="", kw_only=True)
    """Name under which fit_stiffness finds that against tilting by itself; empty: with the radial one."""

    def check(self, where: str) -> None:
        """Raise ValueError, beginning with `where`, for what is no joint."""
        require_positive(where, "stiffness", self.stiffness, "N/m")
        require_positive(where, "rotational_stiffness", self.rotational_stiffness, "N m/rad")
