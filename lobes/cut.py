"""Milling cut and program: geometry, conventions, torque and power."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from lobes.coefficients import check_coefficients, check_number
from modal.arrays import Floats

Direction = Literal["up", "down"]
"""Direction of milling: up (conventional) or down (climb)."""


PITCH_SUM_TOLERANCE = np.radians(1e-3)
"""Largest deviation of the pitch sum from a turn (rad): angles may have three decimals of a degree."""
PITCH_TOLERANCE = 1e-9
"""Largest difference of equal angles (rad)."""


def normalize_pitch(pitch: Sequence[float], teeth: int) -> tuple[float, ...]:
    """Make equal pitches (rad) exactly equal, and scale them to a turn; () if all are equal.

    Raises ValueError unless there is one > 0 for each tooth and they sum to a turn.
    """
    if not pitch:
        return ()
    shown = f"pitch [{', '.join(f'{np.degrees(angle):g}' for angle in pitch)}]"
    if len(pitch) != teeth:
        raise ValueError(f"{shown} degrees has {len(pitch)} angles for {teeth} flutes. Give one angle per flute.")
    if not all(np.isfinite(angle) and angle > 0 for angle in pitch):
        raise ValueError(f"{shown} degrees has an angle that is not > 0")
    if abs(sum(pitch) - 2 * np.pi) > PITCH_SUM_TOLERANCE:
        raise ValueError(f"{shown} sums to {np.degrees(sum(pitch)):g} degrees instead of 360. Measure the pitch again.")
    alike = [next(other for other in pitch if abs(other - angle) < PITCH_TOLERANCE) for angle in pitch]
    return () if len(set(alike)) == 1 else tuple(float(angle) * 2 * np.pi / sum(alike) for angle in alike)


@dataclass(frozen=True)
class Cut:
    """Milling cut, with the conventions of this package.

    x is the feed, y the normal to it; the tooth angle phi runs clockwise from +y (rad). A tooth at phi in a cut
    of depth b answers the displacement q = (x, y) with the force F = -b H(phi) (q(t) - q(t - tau)),
    H = [[(Kt c + Kr s) s, (Kt c + Kr s) c], [(-Kt s + Kr c) s, (-Kt s + Kr c) c]], s = sin phi, c = cos phi,
    tau the time since the previous tooth passed.

    Process damping: the flank of the tooth indents the wavy surface and resists the velocity v_r of the tooth along
    the normal n = (s, c) of the surface with -b C / V v_r n, V = pi D rpm / 60 the surface speed. C / D is enough, as
    C / V = C / D 60 / (pi rpm).
    Source: Tyler & Schmitz, Analytical process damping stability prediction, J. Manuf. Process. 15 (2013) 69-76.

    Raises
    ------
    ValueError
        For a value that no cut has.

    Examples
    --------
    >>> slot = Cut(teeth=2, immersion=1.0, direction="up", tangential=700e6, radial=200e6)
    >>> round(float(np.degrees(slot.exit_angle - slot.entry_angle))), slot.teeth_in_cut  # degrees, -
    (180, 1.0)
    >>> side = Cut(teeth=4, immersion=0.25, direction="down", tangential=700e6, radial=200e6)
    >>> round(float(np.degrees(side.entry_angle)), 1), round(float(np.degrees(side.exit_angle)), 1)  # degrees
    (120.0, 180.0)
    """

    teeth: int
    """Number of teeth N."""
    immersion: float
    """Radial depth of cut ae over cutter diameter, above 0 up to 1 (a slot)."""
    direction: Direction
    """Direction of milling, "up" (conventional) or "down" (climb); no difference in a slot."""
    tangential: float
    """Tangential cutting coefficient Kt (Pa)."""
    radial: float
    """Radial cutting coefficient Kr (Pa)."""
    helix_lag: float = 0.0
    """Lag of a helical tooth along the axis, 2 tan(helix angle) / diameter (rad/m); 0 for straight teeth."""
    feed_angle: float = 0.0
    """Angle from x to the feed (rad): 0 feeds along x, pi/2 along y; angles half a turn apart are equivalent."""
    pitch: tuple[float, ...] = ()
    """Angle from each tooth to the previous one (rad), in order of entry; () for evenly spaced teeth."""
    process_damping: float = 0.0
    """Process damping coefficient C over cutter diameter D (Pa); 0 for none."""

    def __post_init__(self) -> None:
        """Check the values."""
        if not (self.teeth >= 1 and self.teeth == int(self.teeth)):
            raise ValueError(f"teeth={self.teeth} is not a whole number >= 1. Give the number of flutes.")
        if not 0 < self.immersion <= 1:
            text = "Give the radial depth of cut ae divided by the cutter diameter."
            raise ValueError(f"immersion={self.immersion} is not in (0, 1]. {text}")
        if self.direction not in get_args(Direction):
            raise ValueError(f'direction={self.direction!r} is neither "up" nor "down". A slot may have either.')
        check_coefficients(self.tangential, self.radial)
        text = "rad/m is not a finite number >= 0. Give 2 tan(helix angle) / diameter."
        check_number("helix_lag", self.helix_lag, text, may_be_zero=True)
        text = "Pa is not a finite number >= 0. Give the process damping coefficient C divided by the cutter diameter."
        check_number("process_damping", self.process_damping, text, may_be_zero=True)
        if not np.isfinite(self.feed_angle):
            raise ValueError(
                f"feed_angle={self.feed_angle} rad is not finite. Give 0 for a feed along x, pi/2 along y."
            )
        object.__setattr__(self, "pitch", normalize_pitch(self.pitch, self.teeth))

    @property
    def entry_angle(self) -> float:
        """Angle phi_st at which a tooth enters the cut (rad)."""
        return 0.0 if self.direction == "up" else float(np.arccos(2 * self.immersion - 1))

    @property
    def exit_angle(self) -> float:
        """Angle phi_ex at which a tooth leaves the cut (rad)."""
        return float(np.arccos(1 - 2 * self.immersion)) if self.direction == "up" else float(np.pi)

    @property
    def mean_angle(self) -> float:
        """Average angle of a tooth in the cut (rad)."""
        return (self.entry_angle + self.exit_angle) / 2

    @property
    def pitch_pattern(self) -> tuple[float, ...]:
        """Repeating part of the pitches (rad): one of even teeth, two of 85/95/85/95 degrees."""
        pitch = self.pitch or (2 * np.pi / self.teeth,)
        return next(pitch[:k] for k in range(1, len(pitch) + 1) if pitch[:k] * (len(pitch) // k) == pitch)

    @property
    def repeats_per_turn(self) -> int:
        """Number of pitch patterns per turn; the number of teeth if they are evenly spaced."""
        return self.teeth // len(self.pitch_pattern)

    @property
    def lead_angles(self) -> Floats:
        """Angle of each tooth ahead of the first (rad), shape (teeth,); not above 0 for uneven teeth."""
        if not self.pitch:
            return np.asarray(np.arange(self.teeth) * 2 * np.pi / self.teeth)
        return np.asarray(-np.cumsum((0.0, *self.pitch[1:])))

    @property
    def delays(self) -> tuple[float, ...]:
        """Distinct pitches (rad), rising."""
        return tuple(sorted(set(self.pitch_pattern)))

    @property
    def teeth_in_cut(self) -> float:
        """Average number of teeth in the cut, Nt* = (phi_ex - phi_st) N / (2 pi)."""
        return (self.exit_angle - self.entry_angle) * self.teeth / (2 * np.pi)

    @property
    def specific_force(self) -> float:
        """Specific cutting force Ks = sqrt(Kt^2 + Kr^2) (Pa)."""
        return float(np.hypot(self.tangential, self.radial))

    @property
    def force_angle(self) -> float:
        """Angle beta between cutting force and surface normal, tan beta = Kt/Kr (rad)."""
        return float(np.arctan2(self.tangential, self.radial))

    @property
    def orientation_factors(self) -> tuple[float, float]:
        """Share of x and of y in the chatter loop of a tooth at the mean angle phi, signed (-).

        mu_x = sin(phi + beta) sin(phi), mu_y = cos(phi + beta) cos(phi). They are H_xx/Ks and H_yy/Ks, to 15 decimals:
        in a slot mu_y is 0, not the rounding of pi/2.
        Source: Tlusty; Schmitz & Smith, Machining Dynamics, ch. 4.
        """
        phi = self.mean_angle - self.feed_angle
        force = phi + self.force_angle
        return round(float(np.sin(force) * np.sin(phi)), 15), round(float(np.cos(force) * np.cos(phi)), 15)


CHECKED_DEPTH_SHARES = (0.25, 0.5, 0.75, 1.0)
"""Shares of its depth at which a stable program must be stable: a stable island above a limit is not usable."""


@dataclass(frozen=True)
class Program:
    """Cut at a spindle speed and an axial depth.

    Raises
    ------
    ValueError
        For a speed or depth that is not > 0.

    Examples
    --------
    >>> slot = Cut(teeth=2, immersion=1.0, direction="up", tangential=700e6, radial=200e6)
    >>> Program(slot, speed_rpm=12000.0, depth=-0.002)
    Traceback (most recent call last):
        ...
    ValueError: depth=-0.002 m is not a finite depth > 0 (1 mm is 1e-3 m)
    """

    cut: Cut
    """Cutter, immersion and material."""
    speed_rpm: float
    """Spindle speed (rpm)."""
    depth: float
    """Axial depth of cut ap (m)."""

    def __post_init__(self) -> None:
        """Check speed and depth."""
        check_number("speed_rpm", self.speed_rpm, "is not a finite speed > 0 rpm")
        check_number("depth", self.depth, "m is not a finite depth > 0 (1 mm is 1e-3 m)")


def mean_torque(cut: Cut, depth: ArrayLike, diameter: float, feed_per_tooth: float, edge: float = 0.0) -> Floats:
    """Return the torque averaged over a turn.

    M = N D / (4 pi) b (Kt f (cos phi_st - cos phi_ex) + Kte (phi_ex - phi_st)); the power is 2 pi n M.

    Parameters
    ----------
    cut : Cut
        Cutter, immersion and material.
    depth : array_like
        Axial depths of cut b (m), any shape.
    diameter : float
        Cutter diameter D (m).
    feed_per_tooth : float
        Feed per tooth f (m).
    edge : float
        Edge coefficient Kte (N/m).

    Returns
    -------
    ndarray
        Torque (N m), shape of depth.

    Raises
    ------
    ValueError
        For values that are not > 0.

    References
    ----------
    Altintas, Manufacturing Automation, 2nd ed., Cambridge 2012, ch. 2.

    Examples
    --------
    Without edge forces the power is the specific force times the chip volume per time:

    >>> slot = Cut(teeth=2, immersion=1.0, direction="up", tangential=700e6, radial=200e6)
    >>> torque = mean_torque(slot, 2e-3, diameter=12e-3, feed_per_tooth=0.1e-3)
    >>> round(float(torque) * 2 * np.pi * 12000 / 60)  # W at 12000 rpm
    672
    >>> round(700e6 * 12e-3 * 2e-3 * 0.1e-3 * 2 * 12000 / 60)  # Kt times m^3/s
    672
    """
    for name, value in (("diameter", diameter), ("feed_per_tooth", feed_per_tooth)):
        check_number(name, value, "m is not a finite number > 0 (1 mm is 1e-3 m)")
    text = "N/m is not a finite number >= 0 (1 N/mm is 1e3 N/m). Leave an unknown edge coefficient out."
    check_number("edge", edge, text, may_be_zero=True)
    chip = feed_per_tooth * (np.cos(cut.entry_angle) - np.cos(cut.exit_angle))
    per_depth = cut.tangential * chip + edge * (cut.exit_angle - cut.entry_angle)
    return np.asarray(cut.teeth * diameter / (4 * np.pi) * per_depth * np.asarray(depth, dtype=np.float64))


def max_depth_for_drive(
    cut: Cut,
    speed_rpm: ArrayLike,
    diameter: float,
    feed_per_tooth: float,
    edge: float = 0.0,
    power: float = float("inf"),
    torque: float = float("inf"),
) -> Floats:
    """Return the largest axial depth that power and torque of the spindle allow at each speed.

    Parameters
    ----------
    cut : Cut
        Cutter, immersion and material.
    speed_rpm : array_like, shape (n,)
        Spindle speeds (rpm).
    diameter : float
        Cutter diameter (m).
    feed_per_tooth : float
        Feed per tooth (m).
    edge : float
        Edge coefficient Kte (N/m).
    power : float
        Largest power of the spindle (W).
    torque : float
        Largest torque of the spindle (N m).

    Returns
    -------
    ndarray, shape (n,)
        Axial depths (m).

    Raises
    ------
    ValueError
        As `mean_torque`, and for a power or a torque that is not > 0.

    Examples
    --------
    >>> slot = Cut(teeth=2, immersion=1.0, direction="up", tangential=700e6, radial=200e6)
    >>> depth = max_depth_for_drive(slot, [6000.0, 12000.0], 12e-3, 0.1e-3, power=1000.0, torque=1.0)
    >>> (depth * 1e3).round(2).tolist()  # mm: the torque sets the first, the power the second
    [3.74, 2.98]
    """
    for name, value in (("power", power), ("torque", torque)):
        if not value > 0:
            raise ValueError(f"{name}={value} is not > 0. Leave {name} out if the drive has no {name} limit.")
    turning = 2 * np.pi * np.asarray(speed_rpm, dtype=np.float64) / 60
    allowed = np.minimum(torque, power / turning)
    return np.asarray(allowed / mean_torque(cut, 1.0, diameter, feed_per_tooth, edge))
