"""Where to look for settings: what a diagram by zero order promises at each speed, over all of the doubt."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from lobewatch.machine import Machine, ProgramTable, drive_limit
from lobewatch.tool.assembly import Assembly
from lobewatch.tool.mean_lobes import mean_lobes
from lobewatch.verdicts.draws import ProgramDraws

GRID = 0.002
"""Relative step of the speeds."""
BESIDE = 0.003
"""Relative distance of the frequency that is counted on beside speed and fall."""
APART = 0.02
"""Relative distance of two speeds that are worth looking at both."""
VALLEY = 0.8
"""Share of the shallower of two pockets, less than which is promised between them."""
ENOUGH = 0.95
"""Share of a depth that is promised at all speeds of its window ..."""
NEAR = 0.05
"""... which is followed so far, relatively."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Promise:
    """Depths that are likely to be safe; nothing is judged yet."""

    speeds: Floats
    """Speeds (rpm), rising, shape (n,)."""
    depths: Floats
    """Depth (mm) promised there, shape (n,)."""

    @classmethod
    def of(
        cls, program: ProgramTable, draws: ProgramDraws, assembly: Assembly, machine: Machine, fall: float, spare: float
    ) -> Promise:
        """What holds around each speed as far as speed and frequency may be off, now and after a fall of the frequency.

        spare: depth to spare in the middle of the doubt at least. No deeper than tool and drive allow.
        """
        low, high = machine.speed.low_rpm, machine.speed.high_rpm
        speeds = np.geomspace(low, high, max(int(math.log(high / low) / GRID), 2))
        limit = mean_lobes(assembly.x, assembly.y, draws.cuts, speeds, assembly.cross).depth * 1e3
        steps, ahead = math.ceil((draws.doubt.speed + BESIDE + fall / 2) / GRID), round(fall / 2 / GRID)
        around = scipy.ndimage.minimum_filter1d(np.minimum(limit, 1e6), 2 * steps + 1, origin=-ahead, mode="nearest")
        deepest = np.minimum(program.deepest_mm, 1e3 * drive_limit(machine, program, speeds))
        return cls(speeds, np.minimum(around / max(draws.doubt.tangential.high, 1 + spare), deepest))

    def middles(self, depth_mm: float) -> list[float]:
        """The middle (rpm) of each window of speeds at which a depth (mm) is promised."""
        return [float(self.speeds[run[run.size // 2]]) for run in _runs(self.depths >= depth_mm)]

    def tops(self) -> list[int]:
        """Places with more chips than beside them, the most first, none right beside another."""
        taken: list[int] = []
        for place in self._all_tops():
            if all(abs(place - top) * GRID > APART for top in taken):
                taken.append(place)
        return taken

    def pockets(self) -> list[int]:
        """The place with the most chips of each pocket, the most first."""
        taken: list[int] = []
        for place in self._all_tops():
            if not any(self._joined(place, top) for top in taken):
                taken.append(place)
        return taken

    def middle(self, speed: float, depth_mm: float) -> float:
        """The middle (rpm) of the speeds near one at which next to all of a depth (mm) is promised."""
        near = np.flatnonzero(np.abs(self.speeds / speed - 1) < NEAR)
        windows = (self.speeds[near[run]] for run in _runs(self.depths[near] >= ENOUGH * depth_mm))
        window = next((window for window in windows if window[0] <= speed <= window[-1]), None)
        return speed if window is None else float(window[0] + window[-1]) / 2

    def _all_tops(self) -> list[int]:
        chips = np.pad(self.depths * self.speeds, 1)
        tops = np.flatnonzero((chips[1:-1] >= chips[:-2]) & (chips[1:-1] >= chips[2:]))
        return sorted(tops.tolist(), key=lambda place: -chips[place + 1])

    def _joined(self, first: int, second: int) -> bool:
        """Whether nearly as much is promised all the way between two places."""
        between = self.depths[min(first, second) : max(first, second) + 1]
        return bool(np.min(between) >= VALLEY * min(between[0], between[-1]))


def _runs(wanted: NDArray[np.bool_]) -> list[NDArray[np.intp]]:
    """Places without a gap between them."""
    places: NDArray[np.intp] = np.flatnonzero(wanted)
    runs: Sequence[NDArray[np.intp]] = np.split(places, np.flatnonzero(np.diff(places) > 1) + 1)
    return [run for run in runs if run.size]
