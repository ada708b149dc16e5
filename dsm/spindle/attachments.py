"""Bearings, joints and masses on a shaft, and bearings in series with their housings."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple, get_args

import numpy as np

from dsm.arrays import Complexes, Floats, require_number, require_numbers

RollingElements = Literal["balls", "rollers"]


@dataclass(frozen=True)
class Bearing:
    """Radial spring, with or without damper, between shaft and housing; checked as part of a Spindle.

    Examples
    --------
    >>> bearing = Bearing(position=0.15, stiffness=2e8, housing_stiffness=2e8)
    >>> bearing.support_stiffness / 1e6  # N/um: two equal springs in series
    100.0
    """

    position: float
    """Distance from the tool tip (m)."""
    stiffness: float
    """Radial stiffness (N/m); inf holds the shaft (in series with a compliant housing)."""
    damping: float = field(default=0.0, kw_only=True)
    """Viscous damping parallel to the spring (N s/m)."""
    rotational_stiffness: float = field(default=0.0, kw_only=True)
    """Stiffness against tilting (N m/rad)."""
    housing_stiffness: float = field(default=math.inf, kw_only=True)
    """Radial stiffness of the housing behind the bearing, in series with it (N/m); inf: rigid."""
    group: str = field(default="bearings", kw_only=True)
    """Bearings of one group are calibrated together, in their given ratio; "" is never calibrated."""

    rolling_elements: RollingElements = field(default="balls", kw_only=True)
    """Kind of rolling elements; with balls the stiffness gives a range of the remaining preload."""

    @property
    def support_stiffness(self) -> float:
        """Stiffness of bearing and housing in series (N/m)."""
        if math.isinf(self.stiffness):
            return self.housing_stiffness
        return self.stiffness * (1 / (1 + self.stiffness * (1 / self.housing_stiffness)))

    def check(self, where: str) -> None:
        """Raise ValueError, beginning with `where`, for an invalid bearing.

        Parameters
        ----------
        where : str
            Beginning of the message.
        """
        require_numbers(where, self, {"stiffness": "N/m"}, positive=True, infinite=True)
        require_numbers(where, self, {"damping": "N s/m"})
        if self.rolling_elements not in get_args(RollingElements):
            known = ", ".join(get_args(RollingElements))
            raise ValueError(f"{where}rolling_elements={self.rolling_elements!r} is not one of {known}")
        require_numbers(where, self, {"rotational_stiffness": "N m/rad"})
        require_numbers(where, self, {"housing_stiffness": "N/m"}, positive=True, infinite=True)


@dataclass(frozen=True)
class LumpedMass:
    """Rigid body on the shaft, such as a pulley or a balance ring; checked as part of a Spindle.

    Examples
    --------
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
    """Moment of inertia about the shaft axis (kg m^2); makes frequencies depend on speed."""

    def check(self, where: str) -> None:
        """Raise ValueError, beginning with `where`, for an invalid body.

        Parameters
        ----------
        where : str
            Beginning of the message.
        """
        require_numbers(where, self, {"mass": "kg", "diametral_inertia": "kg m^2", "polar_inertia": "kg m^2"})
        if self.polar_inertia > 2 * self.diametral_inertia * (1 + 1e-9):
            raise ValueError(
                f"{where}polar_inertia={self.polar_inertia} kg m^2 is more than twice diametral_inertia="
                f"{self.diametral_inertia} kg m^2, impossible for a body of revolution"
            )


@dataclass(frozen=True)
class Joint:
    """Compliant joint across the shaft: tool in holder, holder in spindle; checked as part of a Spindle.

    Examples
    --------
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
    """Group in which both stiffnesses are calibrated together; "" is never calibrated."""
    rotational_group: str = field(default="", kw_only=True)
    """Group of the stiffness against tilting in fit_stiffness; "" is that of the radial one."""

    def check(self, where: str) -> None:
        """Raise ValueError, beginning with `where`, for an invalid joint.

        Parameters
        ----------
        where : str
            Beginning of the message.
        """
        require_numbers(where, self, {"stiffness": "N/m", "rotational_stiffness": "N m/rad"}, positive=True)


class Damping(NamedTuple):
    """Damping of a spindle, separate from its stiffness."""

    viscous: Floats
    """Dampers of the bearings (N s/m), shape (n_bearings,)."""
    loss_factor: float
    """Loss factor eta of shaft, bearings, housing and joints (-): stiffness k becomes k (1 + i eta)."""

    @property
    def complexity(self) -> complex:
        """Complex factor 1 + i eta."""
        return 1 + 1j * self.loss_factor


class Supports(NamedTuple):
    """Radial springs with dampers, each in series with its housing; n frequencies, m bearings."""

    spring: Complexes
    """Stiffness of the bearings only, dampers included (N/m), shape (n, m)."""
    housing_compliance: Complexes
    """Compliance of the housings (m/N), shape (m,)."""

    @property
    def motion_share(self) -> Complexes:
        """Share of the shaft motion that strains the bearing and not its housing (-), shape (n, m)."""
        return np.asarray(1 / (1 + self.spring * self.housing_compliance))

    @property
    def stiffness(self) -> Complexes:
        """Stiffness of bearing and housing in series (N/m), shape (n, m)."""
        return self.spring * self.motion_share

    @property
    def stiffness_slope(self) -> Complexes:
        """Derivative of that stiffness by the stiffness of the bearing (-), shape (n, m)."""
        return self.motion_share**2

    def across(self, compliance: Complexes) -> Complexes:
        """Return the compliance across the bearing springs, (n, m, m), from that of the shaft on them (m/N).

        A pair of forces across a spring moves the shaft with the share a of it, and the housing by a times its
        compliance.
        """
        matrices = self.motion_share[:, :, np.newaxis] * compliance * self.motion_share[:, np.newaxis]
        diagonal = np.arange(self.housing_compliance.size)
        matrices[:, diagonal, diagonal] += self.motion_share * self.housing_compliance
        return matrices


def supports(bearings: Sequence[Bearing], w: Complexes, damping: Damping) -> Supports:
    """Return the supports of bearings at angular frequencies w (rad/s), shape (n,); one damper for each bearing."""
    stiffness = np.array([bearing.stiffness for bearing in bearings])
    softness = np.array([1 / bearing.housing_stiffness for bearing in bearings])
    spring = damping.complexity * stiffness + 1j * w[:, np.newaxis] * damping.viscous
    return Supports(spring, softness / damping.complexity)


def damping_of_bearings(bearings: Sequence[Bearing], loss_factor: float) -> Damping:
    """Return the dampers of bearings with a loss factor; ValueError for a negative one."""
    require_number("loss_factor", loss_factor)
    return Damping(np.array([bearing.damping for bearing in bearings], dtype=np.float64), loss_factor)
