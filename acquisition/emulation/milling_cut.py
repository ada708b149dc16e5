"""A milling cut as it happens: cutter, part, and a tool tip that gives way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.emulation.hammered_structure import Structure


@dataclass(frozen=True, eq=False)
class MillingCut:
    """A cut and the machine that makes it; conventions of `lobes.Cut`, whose angles and coefficients it takes.

    x and y are axes of the machine, x along the feed at feed_angle = 0; the tooth angle runs clockwise from the normal
    of the feed (rad). Raises ValueError for what is no cut.
    """

    teeth: int
    """Number of teeth."""
    entry_angle: float
    """Angle at which a tooth enters the cut (rad), 0 to pi."""
    exit_angle: float
    """Angle at which it leaves (rad), entry_angle to pi."""
    tangential: float
    """Tangential cutting coefficient Kt (Pa)."""
    radial: float
    """Radial cutting coefficient Kr (Pa)."""
    depth: float
    """Axial depth (m)."""
    feed_per_tooth: float
    """Feed per tooth (m)."""
    speed_rpm: float
    """True spindle speed (rpm)."""
    x: Structure | None
    """Modes of the tip in x as it turns, its residual left out; None for rigid."""
    y: Structure | None
    """Modes of the tip in y, likewise."""
    runout: tuple[float, ...] = ()
    """Distance that each tooth stands out (m), `teeth` of them; none where all stand alike."""
    tangential_edge: float = 0.0
    """Tangential force of an edge wherever it is in the arc of cut, whatever its chip (N/m)."""
    radial_edge: float = 0.0
    """The same, radial (N/m)."""
    helix_lag: float = 0.0
    """Lag of a helical tooth along the axis (rad/m); 0 for straight teeth."""
    feed_angle: float = 0.0
    """Angle from x to the feed (rad)."""
    pitch: tuple[float, ...] = ()
    """Angle by which each tooth follows the tooth before it (rad), in order of entry; () for evenly spaced teeth."""

    def __post_init__(self) -> None:
        """Refuse what cannot be simulated."""
        if self.teeth < 1 or self.teeth != int(self.teeth):
            raise ValueError(f"teeth={self.teeth} is not a whole number >= 1")
        if not 0 <= self.entry_angle < self.exit_angle <= np.pi + 1e-9:
            raise ValueError(f"angles {self.entry_angle} to {self.exit_angle} rad: give 0 <= entry < exit <= pi")
        above = (self.tangential, self.depth, self.feed_per_tooth, self.speed_rpm)
        if not (min(above) > 0 and sum(above) < np.inf):
            raise ValueError(
                f"tangential={self.tangential} Pa, depth={self.depth} m, feed_per_tooth={self.feed_per_tooth} m and "
                f"speed_rpm={self.speed_rpm} must be finite and > 0"
            )
        least = (self.radial, self.tangential_edge, self.radial_edge, self.helix_lag)
        if not (min(least) >= 0 and sum(least) < np.inf):
            raise ValueError(f"radial, tangential_edge, radial_edge, helix_lag = {least} must be finite and >= 0")
        if len(self.runout) not in (0, self.teeth):
            raise ValueError(f"runout has {len(self.runout)} values for {self.teeth} teeth; give one a tooth, or none")
        if self.pitch and not (len(self.pitch) == self.teeth and min(self.pitch) > 0 and self._is_turn):
            raise ValueError(f"pitch={self.pitch} rad: give one above 0 for each of {self.teeth} teeth, a turn in all")
        if self.x is None and self.y is None:
            raise ValueError("x and y are both rigid; give the modes of one direction at least")

    @property
    def _is_turn(self) -> bool:
        return abs(sum(self.pitch) - 2 * np.pi) < 1e-6

    @property
    def tooth_period(self) -> float:
        """From tooth to tooth, in the mean (s)."""
        return 60 / (self.teeth * self.speed_rpm)


@dataclass(frozen=True)
class Passage:
    """How the tool goes through the part; raises ValueError for times below 0 and for no cut at all."""

    before: float = 0.4
    """Time that the spindle turns without a cut (s)."""
    ramp: float = 0.05
    """Time in which the depth grows from 0 to all of it, and in which it falls again (s)."""
    steady: float = 1.1
    """Time at full depth (s)."""
    after: float = 0.2
    """Time without a cut again (s)."""

    def __post_init__(self) -> None:
        """Refuse times that are none."""
        if not (min(self.before, self.ramp, self.steady, self.after) >= 0 and self.cutting > 0):
            raise ValueError(f"{self}: times must be >= 0, and ramp or steady > 0")

    def depth_at(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Share of the depth at times since first contact (s)."""
        times = [0.0, self.ramp, self.ramp + self.steady, self.cutting]
        return np.interp(time, times, [float(self.ramp == 0), 1.0, 1.0, 0.0])

    @property
    def cutting(self) -> float:
        """From first to last contact (s)."""
        return 2 * self.ramp + self.steady

    @property
    def seconds(self) -> float:
        """All of it (s)."""
        return self.before + self.cutting + self.after
