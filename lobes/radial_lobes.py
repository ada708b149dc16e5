"""Stability limits with the radial depth as third axis."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from acquisition import Remark
from lobes.cut import Cut
from lobes.stability_lobes import MethodName, StabilityLobes


@dataclass(frozen=True, eq=False)
class RadialLobes:
    """Limiting axial depth over spindle speed and radial depth."""

    speed_rpm: NDArray[np.float64]
    """Spindle speeds (rpm), shape (n,)."""
    immersion: NDArray[np.float64]
    """Radial depths over cutter diameter, shape (r,)."""
    depth: NDArray[np.float64]
    """Limiting depths (m), shape (r, n); inf where there is no limit."""
    method: MethodName
    """Method that the limits were found by."""
    remarks: tuple[Remark, ...]
    """Remarks on what is wrong with the method at the smallest immersion."""


def radial_lobes(limits: Callable[[Cut], StabilityLobes], cut: Cut, immersion: ArrayLike) -> RadialLobes:
    """The limits of a cut at other immersions (r,), each in (0, 1], by any method with its other arguments set:

        radial_lobes(lambda cut: stability_boundary(x, y, cut, speeds, 0.02), cut, np.linspace(0.05, 1, 20))

    Raises ValueError for immersions that are none.

    >>> mode = Mode(frequency=500.0, damping_ratio=0.02, stiffness=2e7)
    >>> slot = Cut(teeth=2, immersion=1.0, direction="up", tangential=700e6, radial=200e6)
    >>> chart = radial_lobes(lambda cut: zero_order([mode], [mode], cut, [9000.0]), slot, [0.25, 0.5, 1.0])
    >>> (chart.depth * 1e3).round(2).tolist()  # mm, by radial depth
    [[6.76], [3.29], [1.28]]
    """
    shares = np.atleast_1d(np.asarray(immersion, dtype=np.float64))
    if shares.ndim != 1 or shares.size == 0:
        raise ValueError(f"immersion has shape {shares.shape}; a 1-D array of at least one value in (0, 1] is needed")
    charts = [limits(replace(cut, immersion=float(share))) for share in shares]
    return RadialLobes(
        speed_rpm=charts[0].speed_rpm,
        immersion=shares,
        depth=np.stack([chart.depth for chart in charts]),
        method=charts[0].method,
        remarks=charts[int(np.argmin(shares))].remarks,
    )
