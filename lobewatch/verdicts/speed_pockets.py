"""Speeds of stable pockets without depths, if only natural frequency and damping are known.

A stiffness stretches all limits alike and moves none of them along the speeds, as long as one mode decides.
"""

import math
from typing import NamedTuple

import numpy as np

from acquisition import Remark
from lobes import find_pockets, rank_pockets
from lobewatch.machine import CutTable, Machine
from lobewatch.machine.settings.drive_power import CutRange
from lobewatch.tool.assembly import Assembly
from lobewatch.tool.principal_directions import lowest_zero_order_lobes
from lobewatch.tool.tap_series import compute_frequency_scatter
from lobewatch.verdicts.uncertainty import DEFAULT_TAP_SCATTER
from modal import Mode

ARBITRARY_STIFFNESS = 1e7
"""Arbitrary modal stiffness (N/m); no result depends on it."""
MAX_POCKET_GAIN = 20.0
"""Largest limit in a pocket over the lowest limit."""
POCKET_SPEED_STEP = 1e-3
"""Relative step of the speeds."""
N_SPEED_POCKETS = 3
"""Number of reported pockets."""
SPEEDS_ONLY_CODE = "speeds-alone"
"""Code of the remark on speed pockets."""


class SpeedPocket(NamedTuple):
    """Stable pocket of unknown depth."""

    speed_rpm: float
    """Speed of its deepest point (rpm)."""
    window_rpm: tuple[float, float]
    """Slowest and fastest speed with at least 0.8 of the largest depth, for any f_n within its uncertainty (rpm)."""
    gain: float
    """Limit there over the lowest limit in the speed range (-), at most `MAX_POCKET_GAIN`."""

    def contains(self, speed_rpm: float) -> bool:
        """Return whether a speed (rpm) is in its window."""
        return self.window_rpm[0] <= speed_rpm <= self.window_rpm[1]


def find_speed_pockets(table: CutTable, assembly: Assembly, machine: Machine) -> list[SpeedPocket]:
    """Find the best pockets of a cut, the largest removal rate first, for a tool tapped without a force sensor.

    By zero-order approximation from the modes followed, both of one stiffness; a direction that was not tapped is
    taken like the other. Those narrower than the uncertainty of f_n are left out. Empty where no such modes are
    known.
    """
    modes, reach = assembly.without_stiffness, CutRange.of(machine, table)
    if not modes or reach.is_empty:
        return []
    sides = [modes.get(name) or next(iter(modes.values())) for name in ("x", "y")]
    x, y = (Mode(mode.frequency, mode.damping_ratio, ARBITRARY_STIFFNESS) for mode in sides)
    width = max(_frequency_uncertainty(assembly, name, machine) for name in modes)
    low, high, beyond = reach.low_rpm, reach.high_rpm, 1 + 2 * width
    speeds = np.geomspace(low / beyond, high * beyond, int(math.log(high / low * beyond**2) / POCKET_SPEED_STEP) + 2)
    lobes = lowest_zero_order_lobes([x], [y], [machine.build_cut(table)], speeds)
    lowest = lobes.minimum.depth
    if not math.isfinite(lowest):
        return []
    candidates = []
    for pocket in rank_pockets(find_pockets(lobes, MAX_POCKET_GAIN * lowest), speeds.size, "removal"):
        window = max(pocket.from_rpm * (1 + width), low), min(pocket.to_rpm * (1 - width), high)
        candidates.append(SpeedPocket(min(max(pocket.speed_rpm, low), high), window, pocket.depth / lowest))
    return [pocket for pocket in candidates if pocket.contains(pocket.speed_rpm)][:N_SPEED_POCKETS]


def _frequency_uncertainty(assembly: Assembly, direction: str, machine: Machine) -> float:
    """Return the relative half-width of f_n: 95 % error of the tap test, and scatter from one to the next."""
    mode = assembly.without_stiffness[direction]
    error = float(mode.standard_error[0]) * mode.quantile() / mode.frequency
    given = machine.doubt.frequency_percent
    scatter = compute_frequency_scatter(assembly.series.get(direction, ())) or DEFAULT_TAP_SCATTER.frequency
    return math.hypot(error if math.isfinite(error) else 0.0, scatter if given is None else given / 100)


def speed_pocket_remarks(table: CutTable, name: str, assembly: Assembly, machine: Machine) -> tuple[Remark, ...]:
    """Return the remark on pockets with unknown depth, if there are any."""
    best = find_speed_pockets(table, assembly, machine)
    if not best:
        return ()
    windows = ((pocket.speed_rpm, *pocket.window_rpm) for pocket in best)
    speeds = ", ".join(f"{speed:.0f} rpm ({math.ceil(low)}..{math.floor(high)})" for speed, low, high in windows)
    text = f"stable pockets of unknown depth: {speeds}"
    return (
        Remark(SPEEDS_ONLY_CODE, name, text, "Find the depth in five test cuts with pocket_depth.find_pocket_depths"),
    )
