"""Where to look for settings: the depth that is likely to be safe at each speed, over all of the doubt.

Zero order narrows; where it is not exact, the multipliers of the middle of the doubt are looked at at coarser speeds,
so that what it does not see (low immersion, flip) counts. Nothing is judged yet.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from lobes import Cut, MillingRows, growth, milling_system, piece_numbers, rows_of
from lobes.floquet.pieces import ROUGH
from lobewatch.machine.settings.cut_range import CutRange
from lobewatch.tool.assembly import Assembly
from lobewatch.tool.mean_lobes import mean_lobes
from lobewatch.verdicts.doubt import Doubt
from lobewatch.verdicts.mean_force import is_constant
from lobewatch.verdicts.room import APART as ROOM

GRID = 0.002
"""Relative step of the speeds."""
COARSE = 6
"""Steps between two speeds at which the multipliers are looked at ..."""
TRIED = np.array([0.3, 0.6, 1.0, 1.6, 2.5])
"""... and shares of the limit by zero order at which they are ..."""
FURTHER = np.array([0.2, 0.5, 1.0])
"""... and of the way from the last of these to the deepest that matters, where none of them chatters."""
FEEDS = 2
"""Number of directions of feed, those that zero order has as the worst at a speed, in which they are."""
WORTH = 0.75
"""Share of the most chips that zero order has, as many of which must be thinkable at a speed for a look."""
MATTERS = 1.3
"""Limits beyond so many times the deepest that may be cut, with all to spare, are not told apart."""
BESIDE = 0.003
"""Relative distance of the frequency that is counted on beside speed and fall."""
APART, FAR = 0.02, 0.05
"""Relative distance of two tops that are worth looking at both, and of speeds that are none."""
VALLEY = 0.8
"""Share of the shallower of two pockets, less than which is likely between them."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LikelyDepths:
    """Depths that are likely to be safe."""

    speeds: Floats
    """Speeds (rpm), rising, shape (n,)."""
    depths: Floats
    """Depth (mm) likely to be safe there, no deeper than tool and drive allow, shape (n,)."""

    def middles(self, depth_mm: float) -> list[float]:
        """The middle (rpm) of each window of speeds at which a depth (mm) is likely."""
        return [float(self.speeds[run[run.size // 2]]) for run in _runs(self.depths >= depth_mm)]

    def tops(self, count: int) -> list[tuple[float, float]]:
        """Speeds (rpm) and depths (mm) with more chips than beside them, the most first; then others apart."""
        chips = np.pad(self.depths * self.speeds, 1)
        tops = np.flatnonzero((chips[1:-1] >= chips[:-2]) & (chips[1:-1] >= chips[2:]))
        order = np.argsort(-chips[1:-1], kind="stable")
        taken: list[int] = []
        for places, apart in ((order[np.isin(order, tops)], APART), (order, FAR)):
            for place in places.tolist():
                if all(abs(place - top) * GRID > apart for top in taken):
                    taken.append(place)
        return [(float(self.speeds[place]), float(self.depths[place])) for place in taken[:count]]

    def is_joined(self, first: float, second: float) -> bool:
        """Whether nearly as much is likely all the way between two speeds (rpm): they lie in one pocket."""
        ends = np.searchsorted(self.speeds, sorted((first, second)))
        between = self.depths[ends[0] : ends[1] + 1]
        return between.size < 2 or bool(np.min(between) >= VALLEY * min(between[0], between[-1]))


def likely_depths(
    reach: CutRange, cuts: Sequence[Cut], spindle: Assembly, doubt: Doubt, fall: float, spare: float
) -> LikelyDepths:
    """What holds around each speed as far as speed and frequency may be off, now and after a fall of the frequency.

    cuts: all that the program makes on its way; spare: depth to spare in the middle of the doubt at least.
    """
    number = max(int(math.log(reach.high_rpm / reach.low_rpm) / GRID), 1)
    speeds = np.geomspace(reach.low_rpm, reach.high_rpm, number + 1)
    by_cut = np.array([mean_lobes(spindle.x, spindle.y, [cut], speeds, spindle.cross).depth for cut in cuts]) * 1e3
    deepest, safe = reach.depths(speeds), max(doubt.tangential.high, 1 + spare)
    by_cut = np.minimum(by_cut, MATTERS * safe * deepest)
    beside = doubt.speed + BESIDE + math.log(ROOM)
    steps, ahead = math.ceil((beside + fall / 2) / GRID), round(fall / 2 / GRID)

    def around(limits: Floats) -> Floats:
        lowest = scipy.ndimage.minimum_filter1d(limits, 2 * steps + 1, origin=-ahead, mode="nearest")
        return np.asarray(np.minimum(lowest / safe, deepest))

    limit = np.min(by_cut, axis=0)
    if not all(map(is_constant, cuts)):
        chips = speeds * around(limit)
        thinkable = speeds * np.minimum(deepest, TRIED[-1] * limit / safe) >= WORTH * np.max(chips)
        wanted = scipy.ndimage.maximum_filter1d(thinkable, 4 * steps + 1)
        limit = _looked_at(spindle, cuts, speeds, by_cut, MATTERS * safe * deepest, wanted)
    return LikelyDepths(speeds, around(limit))


def _looked_at(
    spindle: Assembly, cuts: Sequence[Cut], speeds: Floats, by_cut: Floats, deepest: Floats, wanted: NDArray[np.bool_]
) -> Floats:
    """Limits (mm) by multipliers, up to a depth (mm) (n,), where wanted (n,), between few speeds; else by zero order.

    by_cut: limits by zero order (cuts, n).
    """
    places = np.unique(np.append(np.arange(0, speeds.size, COARSE), speeds.size - 1))
    places = places[wanted[places]]
    systems = [milling_system(spindle.x, spindle.y, vectors) for vectors in spindle.axes.patterns]
    worst, true = np.argsort(by_cut[:, places], axis=0)[:FEEDS], deepest[places].copy()
    for (i, cut), system in itertools.product(enumerate(cuts), systems):
        here = np.flatnonzero(np.any(worst == i, axis=0))
        rows = rows_of(system, cut, speeds[places[here]])
        limit = _first_crossing(rows, np.min(by_cut[:, places[here]], axis=0), deepest[places[here]])
        true[here] = np.minimum(true[here], limit)
    between = np.interp(np.log(speeds), np.log(speeds[places]), true)
    return np.asarray(np.where(wanted, between, np.min(by_cut, axis=0)))


def _first_crossing(rows: MillingRows, mean: Floats, most: Floats) -> Floats:
    """Depth (mm) (r,) at which growth first reaches zero, on a line between looks; inf where it does not.

    mean: limit by zero order (mm) (r,); most: depth up to which it matters.
    """
    ends = np.minimum(mean * TRIED[-1], most)[:, np.newaxis]
    tried = np.minimum(mean[:, np.newaxis] * TRIED, most[:, np.newaxis])
    limit = _crossing(rows, tried)
    beyond = np.flatnonzero(np.isinf(limit) & (ends[:, 0] < most))
    further = ends[beyond] * (1 - FURTHER) + most[beyond, np.newaxis] * FURTHER
    limit[beyond] = _crossing(rows[beyond], further)
    return limit


def _crossing(rows: MillingRows, depths: Floats) -> Floats:
    """The same between depths (mm) (r, d)."""
    if not depths.size:
        return np.empty(0)
    grown = growth(rows, depths / 1e3, piece_numbers(rows, float(np.max(depths)) / 1e3, ROUGH))
    first, row = np.argmax(grown >= 0, axis=1), np.arange(len(grown))
    before = np.maximum(first - 1, 0)
    low, high = grown[row, before], grown[row, first]
    share = np.where(first > 0, -low / np.where(high == low, 1.0, high - low), 0.5)
    begin = np.where(first > 0, depths[row, before], 0.0)
    return np.where(np.any(grown >= 0, axis=1), begin + share * (depths[row, first] - begin), np.inf)


def _runs(wanted: NDArray[np.bool_]) -> list[NDArray[np.intp]]:
    """Places without a gap between them."""
    places: NDArray[np.intp] = np.flatnonzero(wanted)
    runs: Sequence[NDArray[np.intp]] = np.split(places, np.flatnonzero(np.diff(places) > 1) + 1)
    return [run for run in runs if run.size]
