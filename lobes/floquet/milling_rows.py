"""One cut on many machines at once: r rows that differ in their numbers, not in their make."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lobes.cut import Cut
from lobes.milling_system import MillingSystem, seen_at_tip

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class MillingRows:
    """r systems of n modes in the same p directions, each with its own speed, coefficients and feed direction."""

    cut: Cut
    """Teeth, immersion, direction of milling and helix of all rows; its coefficients and feed angle do not count."""
    direction: NDArray[np.int64]
    """Row of `axes` in which each mode was tapped, shape (n,)."""
    axes: NDArray[np.int64]
    """Directions that give way, 0 for x and 1 for y, shape (p,)."""
    frequency: Floats
    """Natural frequencies (rad/s), shape (r, n)."""
    damping_ratio: Floats
    """Damping ratios, shape (r, n)."""
    stiffness: Floats
    """Stiffnesses at the tool tip along their directions (N/m), shape (r, n)."""
    phase: Floats
    """Phases of the modal constants (rad), shape (r, n); 0 for real modes."""
    vector: Floats
    """Directions of the modes in `axes`, shape (r, n, p): what each takes of a force, and shows. 1 and 0 along one."""
    speed_rpm: Floats
    """Spindle speeds (rpm), shape (r,)."""
    tangential: Floats
    """Cutting coefficients Kt (Pa), shape (r,)."""
    radial: Floats
    """Cutting coefficients Kr (Pa), shape (r,)."""
    feed_angle: Floats
    """Angles from x to the feed (rad), shape (r,)."""

    def __len__(self) -> int:
        """Number of rows."""
        return self.speed_rpm.size

    def __getitem__(self, which: Any) -> MillingRows:
        """Some of the rows, by an index array or a mask."""
        return replace(self, **{name: getattr(self, name)[which] for name in _VARYING})

    def fed_at(self, angle: float) -> MillingRows:
        """All rows with the feed at an angle from x (rad)."""
        return replace(self, feed_angle=np.full(len(self), angle))

    def making(self, cut: Cut) -> MillingRows:
        """All rows with the teeth, immersion and feed of a cut; their coefficients stay."""
        return replace(self, cut=cut).fed_at(cut.feed_angle)

    @property
    def seen(self) -> tuple[Floats, Floats]:
        """What the tip shows of each mode's coordinate q and of its velocity q' / w, each of shape (r, n)."""
        return seen_at_tip(self.damping_ratio, self.phase)

    @property
    def tooth_period(self) -> Floats:
        """Mean time between two teeth (s), shape (r,)."""
        return np.asarray(60 / (self.cut.teeth * self.speed_rpm))

    @property
    def period(self) -> Floats:
        """Time after which the cut repeats (s), shape (r,): the tooth period of evenly spaced teeth."""
        return self.tooth_period * len(self.cut.pattern)

    @property
    def force(self) -> Floats:
        """Largest entry that the force matrix of a tooth can have, Ks (Pa), shape (r,)."""
        return np.asarray(np.hypot(self.tangential, self.radial))


_VARYING = (
    "frequency",
    "damping_ratio",
    "stiffness",
    "phase",
    "vector",
    "speed_rpm",
    "tangential",
    "radial",
    "feed_angle",
)


def joined_rows(first: MillingRows, second: MillingRows) -> MillingRows:
    """The rows of both, of the same cut and make."""
    columns: dict[str, Any] = {name: np.concatenate((getattr(first, name), getattr(second, name))) for name in _VARYING}
    return replace(first, **columns)


def rows_of(system: MillingSystem, cut: Cut, speed_rpm: Floats) -> MillingRows:
    """One system and cut at many speeds (rpm), shape (r,).

    >>> mode = Mode(frequency=500.0, damping_ratio=0.02, stiffness=2e7)
    >>> slot = Cut(teeth=2, immersion=1.0, direction="up", tangential=700e6, radial=200e6)
    >>> rows = rows_of(milling_system([mode], None), slot, np.array([6000.0, 12000.0]))
    >>> (rows.tooth_period * 1e3).tolist()  # ms
    [5.0, 2.5]
    """
    ones = np.ones((speed_rpm.size, 1))
    return MillingRows(
        cut=cut,
        direction=system.direction,
        axes=system.axes,
        frequency=ones * system.frequency,
        damping_ratio=ones * system.damping_ratio,
        stiffness=ones * (system.frequency / system.shape) ** 2,
        phase=ones * system.phase,
        vector=np.tile(system.vector, (speed_rpm.size, 1, 1)),
        speed_rpm=speed_rpm,
        tangential=np.full(speed_rpm.shape, cut.tangential),
        radial=np.full(speed_rpm.shape, cut.radial),
        feed_angle=np.full(speed_rpm.shape, cut.feed_angle),
    )
