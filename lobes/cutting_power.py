"""What a cut asks of the drive."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lobes.cut import Cut


def mean_torque(
    cut: Cut, depth: ArrayLike, diameter: float, feed_per_tooth: float, edge: float = 0.0
) -> NDArray[np.float64]:
    """Torque averaged over a turn (N m) at axial depths b (m), shape of depth.

    M = N D / (4 pi) b (Kt f (cos phi_st - cos phi_ex) + Kte (phi_ex - phi_st)): diameter D (m), feed per tooth f (m),
    edge coefficient Kte (N/m). Power is 2 pi n M. Raises ValueError for values that are not > 0.
    Source: Altintas, Manufacturing Automation, 2nd ed., Cambridge 2012, ch. 2.

    Power by torque is the specific force times the chips removed, where edges cost nothing:

    >>> slot = Cut(teeth=2, immersion=1.0, direction="up", tangential=700e6, radial=200e6)
    >>> torque = mean_torque(slot, 2e-3, diameter=12e-3, feed_per_tooth=0.1e-3)
    >>> round(float(torque) * 2 * np.pi * 12000 / 60)  # W at 12000 rpm
    672
    >>> round(700e6 * 12e-3 * 2e-3 * 0.1e-3 * 2 * 12000 / 60)  # Kt times m^3/s
    672
    """
    for name, value in (("diameter", diameter), ("feed_per_tooth", feed_per_tooth)):
        if not (np.isfinite(value) and value > 0):
            raise ValueError(f"{name}={value} m is not a finite number > 0; 1 mm is 1e-3")
    if not (np.isfinite(edge) and edge >= 0):
        raise ValueError(f"edge={edge} N/m is not a finite number >= 0; 1 N/mm is 1e3, leave it out where not known")
    chip = feed_per_tooth * (np.cos(cut.entry_angle) - np.cos(cut.exit_angle))
    per_depth = cut.tangential * chip + edge * (cut.exit_angle - cut.entry_angle)
    return np.asarray(cut.teeth * diameter / (4 * np.pi) * per_depth * np.asarray(depth, dtype=np.float64))


def deepest_for_drive(
    cut: Cut,
    speed_rpm: ArrayLike,
    diameter: float,
    feed_per_tooth: float,
    edge: float = 0.0,
    power: float = float("inf"),
    torque: float = float("inf"),
) -> NDArray[np.float64]:
    """Deepest axial depth (m) that a power (W) and a torque (N m) of the spindle allow at each speed (rpm), shape (n,).

    diameter, feed_per_tooth (m) and edge (N/m) as for `mean_torque`; power = 2 pi n M. Raises ValueError as that, and
    for a power or a torque that is not > 0.

    >>> slot = Cut(teeth=2, immersion=1.0, direction="up", tangential=700e6, radial=200e6)
    >>> depth = deepest_for_drive(slot, [6000.0, 12000.0], 12e-3, 0.1e-3, power=1000.0, torque=1.0)
    >>> (depth * 1e3).round(2).tolist()  # mm: the torque sets the first, the power the second
    [3.74, 2.98]
    """
    for name, value in (("power", power), ("torque", torque)):
        if not value > 0:
            raise ValueError(f"{name}={value} is not > 0; leave it out where the drive has no such limit")
    turning = 2 * np.pi * np.asarray(speed_rpm, dtype=np.float64) / 60
    allowed = np.minimum(torque, power / turning)
    return np.asarray(allowed / mean_torque(cut, 1.0, diameter, feed_per_tooth, edge))
