"""Where the pockets between the lobes are when only natural frequency and damping are known: speeds without depths.

A stiffness stretches all limits alike and moves none of them along the speeds, as long as one mode decides.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acquisition import Remark
from lobes import best_pockets, pockets
from lobewatch.machine import CutTable, Machine
from lobewatch.machine.settings.cut_range import CutRange
from lobewatch.tool.assembly import Assembly
from lobewatch.tool.mean_lobes import mean_lobes
from lobewatch.tool.series import frequency_scatter
from lobewatch.verdicts.doubt import SCATTER
from modal import Mode

ANY_STIFFNESS = 1e7
"""Stiffness that stands for all (N/m): no result depends on it."""
MOST_GAIN = 20.0
"""Limit in a pocket over the lowest one that stands for more, too."""
STEP = 1e-3
"""Relative step of the speeds."""
COUNT = 3
"""Number of pockets that are told."""
SPEEDS_ALONE = "speeds-alone"
"""Code of the remark on them."""


@dataclass(frozen=True)
class SpeedPocket:
    """A pocket whose depth is not known."""

    speed_rpm: float
    """Speed of its deepest point (rpm)."""
    window_rpm: tuple[float, float]
    """Slowest and fastest speed at which the limit is 0.8 of its deepest or more, wherever f_n is within its doubt."""
    gain: float
    """Limit there over the lowest one in the range of speeds (-); MOST_GAIN stands for more, too."""

    def holds(self, speed_rpm: float) -> bool:
        """Whether a speed (rpm) lies in its window."""
        return self.window_rpm[0] <= speed_rpm <= self.window_rpm[1]


def speed_pockets(table: CutTable, assembly: Assembly, machine: Machine) -> list[SpeedPocket]:
    """The best pockets of a cut, the largest removal rate first, of a tool that was tapped without force.

    By zero order from the modes followed, both of one stiffness; a direction that was not tapped is taken like the
    other. Those narrower than the doubt of f_n are left out. Empty where no such modes are known.
    """
    modes, reach = assembly.unweighed, CutRange.of(machine, table)
    if not modes or reach.is_empty:
        return []
    x, y = (_weighed(modes.get(name) or next(iter(modes.values()))) for name in ("x", "y"))
    width = max(_doubt(assembly, name, machine) for name in modes)
    low, high, beyond = reach.low_rpm, reach.high_rpm, 1 + 2 * width
    speeds = np.geomspace(low / beyond, high * beyond, int(math.log(high / low * beyond**2) / STEP) + 2)
    lobes = mean_lobes([x], [y], [machine.build_cut(table)], speeds)
    lowest = lobes.minimum.depth
    if not math.isfinite(lowest):
        return []
    candidates = [
        SpeedPocket(
            min(max(pocket.speed_rpm, low), high),
            (max(pocket.from_rpm * (1 + width), low), min(pocket.to_rpm * (1 - width), high)),
            pocket.depth / lowest,
        )
        for pocket in best_pockets(pockets(lobes, MOST_GAIN * lowest), speeds.size, "removal")
    ]
    return [pocket for pocket in candidates if pocket.holds(pocket.speed_rpm)][:COUNT]


def _weighed(mode: Mode) -> Mode:
    return Mode(mode.frequency, mode.damping_ratio, ANY_STIFFNESS)


def _doubt(assembly: Assembly, direction: str, machine: Machine) -> float:
    """Half-width of f_n, relative: of the tap test (95 %), and from one to the next."""
    mode = assembly.unweighed[direction]
    error = float(mode.standard_error[0]) * mode.quantile() / mode.frequency
    given = machine.doubt.frequency_percent
    scatter = frequency_scatter(assembly.series.get(direction, ())) or SCATTER.frequency
    return math.hypot(error if math.isfinite(error) else 0.0, scatter if given is None else given / 100)


def pockets_text(best: Sequence[SpeedPocket]) -> str:
    """Speeds of pockets, for people; windows rounded inwards."""
    windows = ((pocket.speed_rpm, *pocket.window_rpm) for pocket in best)
    return ", ".join(f"{speed:.0f} rpm ({math.ceil(low)}..{math.floor(high)})" for speed, low, high in windows)


def pockets_remark(table: CutTable, name: str, assembly: Assembly, machine: Machine) -> tuple[Remark, ...]:
    """Remark on the pockets of a cut whose depths are not known; none where none are found."""
    best = speed_pockets(table, assembly, machine)
    if not best:
        return ()
    text = f"pockets by frequency and damping: {pockets_text(best)}; how deep, test cuts tell"
    return (Remark(SPEEDS_ALONE, name, text, "lobewatch suggest leads to a depth in five test cuts"),)
