"""Stability lobes by a chosen method and source of dynamics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from acquisition import Frf
from lobes import Cut, StabilityLobes, average_angle_lobes, lower_envelope, stability_boundary, zero_order_lobes
from lobes.tip_response import TipData
from lobewatch.machine import REFERENCE_CUT, CutTable, Machine
from lobewatch.tool.assembly import Assembly

MAX_CHART_SPEEDS = 400
"""Largest number of speeds of a chart by semi-discretisation."""
MAX_CHART_DEPTH_RATIO = 12.0
"""Depth up to which it looks, as a multiple of the lowest limit by zero order."""


class LobeMethod(StrEnum):
    """Method by which limits are found."""

    ZERO_ORDER = "zero-order"
    """`lobes.zero_order_lobes`."""
    AVERAGE_ANGLE = "average-angle"
    """`lobes.average_angle_lobes`."""
    SEMI_DISCRETISATION = "semi-discretisation"
    """`lobes.stability_boundary`."""


class DynamicsSource(StrEnum):
    """Dynamics that lobes are computed from."""

    MODES = "modes"
    """Fitted modes."""
    FRF = "frf"
    """The measured FRF itself."""


@dataclass(frozen=True, eq=False)
class LobeChart:
    """The lobes of one cut, and what they came from."""

    name: str
    """Name of the cut."""
    table: CutTable
    """The cut as it stands in machine.toml."""
    assembly: Assembly
    """The tool in the spindle, as measured or predicted."""
    source: DynamicsSource
    """Dynamics of it that were used."""
    x: TipData | None
    """Dynamics at the tool tip in the feed direction; None where they are not known."""
    y: TipData | None
    """Dynamics at the tool tip normal to the feed; None where they are not known."""
    cuts: tuple[Cut, ...]
    """The cut in SI units, one a direction of feed."""
    lobes: StabilityLobes
    """Limits of the cut."""


def find_cut_table(machine: Machine, name: str) -> CutTable:
    """The reference cut or a program by its name; KeyError for one that is not there."""
    for table in machine.program:
        if table.name == name:
            return table
    if name != REFERENCE_CUT or machine.reference_cut is None:
        raise KeyError(name)
    return machine.reference_cut


def compute_lobe_chart(
    method: LobeMethod, x: TipData | None, y: TipData | None, cuts: Sequence[Cut], speed_rpm: NDArray[np.float64]
) -> StabilityLobes:
    """The lowest lobes of a cut in its directions of feed over speeds (rpm), fewer of them by semi-discretisation.

    >>> mode = Mode(frequency=500.0, damping_ratio=0.02, stiffness=2e7)
    >>> slot = Cut(teeth=2, immersion=1.0, direction="up", tangential=700e6, radial=200e6)
    >>> lobes = compute_lobe_chart(LobeMethod.ZERO_ORDER, [mode], [mode], [slot], np.array([9000.0, 15000.0]))
    >>> (lobes.depth * 1e3).round(2).tolist()  # mm
    [1.28, 18.77]
    """
    return lower_envelope([_compute_cut_lobes(method, x, y, cut, speed_rpm) for cut in cuts])


def _compute_cut_lobes(
    method: LobeMethod, x: TipData | None, y: TipData | None, cut: Cut, speed_rpm: NDArray[np.float64]
) -> StabilityLobes:
    if method is LobeMethod.AVERAGE_ANGLE:
        return average_angle_lobes(x, y, cut, speed_rpm)
    mean = zero_order_lobes(x, y, cut, speed_rpm)
    if method is LobeMethod.ZERO_ORDER:
        return mean
    if isinstance(x, Frf) or isinstance(y, Frf):
        raise ValueError(
            "compute_lobe_chart.method semi-discretisation works from the modes; leave LobeChart.source frf out"
        )
    speeds = np.linspace(speed_rpm[0], speed_rpm[-1], min(MAX_CHART_SPEEDS, speed_rpm.size))
    lowest = mean.minimum.depth
    return stability_boundary(x, y, cut, speeds, MAX_CHART_DEPTH_RATIO * lowest if np.isfinite(lowest) else 0.1)
