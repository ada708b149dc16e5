"""Stability lobes by a chosen method and source of dynamics."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from acquisition import Frf
from lobes import Cut, StabilityLobes, average_angle_lobes, lower_envelope, stability_boundary, zero_order_lobes
from lobes.tip_response import TipData
from lobewatch.arrays import Floats
from lobewatch.machine import CutTable
from lobewatch.tool.assembly import Assembly

MAX_CHART_SPEEDS = 400
"""Largest number of speeds of a chart by semi-discretisation."""
MAX_CHART_DEPTH_RATIO = 12.0
"""Depth of a chart over the lowest limit by zero order."""


class LobeMethod(StrEnum):
    """Method of stability limits."""

    ZERO_ORDER = "zero-order"
    """`lobes.zero_order_lobes`."""
    AVERAGE_ANGLE = "average-angle"
    """`lobes.average_angle_lobes`."""
    SEMI_DISCRETISATION = "semi-discretisation"
    """`lobes.stability_boundary`."""


class DynamicsSource(StrEnum):
    """Dynamics behind lobes."""

    MODES = "modes"
    """Fitted modes."""
    FRF = "frf"
    """Measured FRF."""


@dataclass(frozen=True, eq=False)
class LobeChart:
    """Stability lobes of one cut with their inputs."""

    name: str
    """Name of the cut."""
    table: CutTable
    """Cut of machine.toml."""
    assembly: Assembly
    """Tool in the spindle, measured or predicted."""
    source: DynamicsSource
    """Dynamics that were used."""
    x: TipData | None
    """Dynamics at the tool tip along the feed; None if unknown."""
    y: TipData | None
    """Dynamics at the tool tip normal to the feed; None if unknown."""
    cuts: tuple[Cut, ...]
    """Cut in SI units, one per feed direction."""
    lobes: StabilityLobes
    """Stability limits of the cut."""


def compute_lobe_chart(
    method: LobeMethod, x: TipData | None, y: TipData | None, cuts: Sequence[Cut], speed_rpm: Floats
) -> StabilityLobes:
    """Compute the lowest lobes of a cut over its feed directions.

    Parameters
    ----------
    method
        Method of the limits.
    x, y
        Dynamics at the tool tip along and normal to the feed; None for a rigid direction.
    cuts
        Cut in SI units, one per feed direction.
    speed_rpm
        Spindle speeds (rpm), shape (n,); semi-discretisation uses at most 400 of them.

    Returns
    -------
    StabilityLobes
        Limiting depth and chatter frequency over speed.

    Examples
    --------
    >>> mode = Mode(frequency=500.0, damping_ratio=0.02, stiffness=2e7)
    >>> slot = Cut(teeth=2, immersion=1.0, direction="up", tangential=700e6, radial=200e6)
    >>> lobes = compute_lobe_chart(LobeMethod.ZERO_ORDER, [mode], [mode], [slot], np.array([9000.0, 15000.0]))
    >>> (lobes.depth * 1e3).round(2).tolist()  # mm
    [1.28, 18.77]
    """
    if method is LobeMethod.AVERAGE_ANGLE:
        return lower_envelope([average_angle_lobes(x, y, cut, speed_rpm) for cut in cuts])
    means = [zero_order_lobes(x, y, cut, speed_rpm) for cut in cuts]
    if method is LobeMethod.ZERO_ORDER:
        return lower_envelope(means)
    if isinstance(x, Frf) or isinstance(y, Frf):
        text = "semi-discretisation needs modes, not an FRF. Remove LobeChart.source frf."
        raise ValueError(f"compute_lobe_chart.method: {text}")
    speeds = np.linspace(speed_rpm[0], speed_rpm[-1], min(MAX_CHART_SPEEDS, speed_rpm.size))
    lowest = [mean.minimum.depth for mean in means]
    depths = [MAX_CHART_DEPTH_RATIO * depth if np.isfinite(depth) else 0.1 for depth in lowest]
    limits = zip(cuts, depths, strict=True)
    return lower_envelope([stability_boundary(x, y, cut, speeds, depth) for cut, depth in limits])
