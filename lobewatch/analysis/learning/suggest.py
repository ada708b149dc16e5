"""The next test cut: the one with the largest expected gain of removal rate, that is more likely stable than not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lobes import Cut
from lobewatch.analysis.learning.learnt import Learnt
from lobewatch.analysis.learning.likelihood import predicted
from lobewatch.analysis.learning.mean_force import MeanForce, is_constant
from lobewatch.analysis.learning.observed import Heard, Observed
from lobewatch.analysis.learning.priors import Draws

DRAWS = 300
"""That the diagrams are made of."""
STEP = 0.008
"""Relative step of the speeds that are looked at."""
RPM, MM = 10.0, 0.05
"""Steps that can be set at a machine."""
LIKELY = 0.5
"""A test cut is more likely stable than this."""
LOOKED_AT = 6
"""Candidates that are looked at closely, at most."""
APART = 0.03
"""Relative distance of two speeds that are looked at both."""
NEARBY = (1.1, 1.0, 0.85, 0.7, 0.5)
"""Shares of the depth that zero order promises that are looked at where it is not exact."""
GAINED = 0.01
"""An expected gain below this share of the best removal rate so far is none."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Grid:
    """What may be chosen from."""

    cut: Cut
    """Geometry and coefficients of the program."""
    feed_angles: tuple[float, ...]
    """Directions of feed (rad): the worst counts."""
    speeds: Floats
    """Spindle speeds (rpm), rising, shape (s,)."""
    deepest: Floats
    """What tool and drive allow at each (m), shape (s,)."""

    @property
    def depths(self) -> Floats:
        """All depths in steps of 0.05 mm (m), shape (d,)."""
        return np.asarray(np.arange(1, int(np.max(self.deepest) * 1e3 / MM + 1e-6) + 1) * MM / 1e3)

    def seen(self, speed: float, depth: float, word: Heard = Heard.STABLE) -> Observed:
        """A cut of it."""
        return Observed(self.cut, speed, depth, word, feed_angles=self.feed_angles)


@dataclass(frozen=True)
class Suggested:
    """A test cut that is worth making."""

    speed_rpm: float
    depth: float
    """Axial depth (m)."""
    chance: float
    """That it chatters."""
    gain: float
    """Expected gain of removal rate, relative to the best heard stable so far; inf where there is none."""
    settles: str
    """What it tells most of (a name of `Draws.ratios`)."""
    told: float
    """By how many of its standard deviations the two outcomes differ there."""


def speeds_between(low: float, high: float) -> Floats:
    """Speeds that can be set (rpm), in steps of 0.8 % and of 10 rpm."""
    number = max(int(np.log(high / low) / STEP) + 1, 2)
    return np.unique(np.clip(np.round(np.geomspace(low, high, number) / RPM) * RPM, low, high))


def best_heard(cuts: Sequence[Observed]) -> float:
    """Largest speed times depth (rpm m) that was heard stable; 0 where none was."""
    return max((cut.speed_rpm * cut.depth for cut in cuts if not cut.chatters), default=0.0)


def suggest(learnt: Learnt, grid: Grid, heard: Sequence[Observed], seed: int = 0) -> Suggested | None:
    """The next test cut; None where nothing more is to be gained.

    heard: the cuts of this very program. A diagram by zero order proposes; what is chosen was judged by
    semi-discretisation.
    """
    best, draws = best_heard(heard), learnt.sample(DRAWS, seed)
    chips = grid.speeds[:, np.newaxis] * grid.depths
    stable = _shares(_limits(draws, grid), grid.depths)
    wanted = (stable > LIKELY) & (grid.depths <= grid.deepest[:, np.newaxis] + 1e-9)
    gain = np.where(wanted, stable * (chips - best), 0.0)
    least = GAINED * max(best, 1e-3 * float(np.max(chips)))
    found: tuple[float, Suggested] | None = None
    for row, column in _candidates(gain, grid.speeds):
        if gain[row, column] <= max(least, found[0] if found else 0.0):
            break
        for depth in _nearby(float(grid.depths[column]), is_constant(grid.cut)):
            speed = float(grid.speeds[row])
            chance = predicted(grid.seen(speed, depth), draws).chance
            true = float(1 - np.mean(chance)) * (speed * depth - best)
            if np.mean(chance) < 1 - LIKELY and true > max(least, found[0] if found else 0.0):
                relative = true / best if best else np.inf
                found = true, Suggested(speed, depth, float(np.mean(chance)), relative, *_settles(draws.ratios(), chance))
    return None if found is None else found[1]


def _limits(draws: Draws, grid: Grid) -> Floats:
    """Limits (m) of draws over the speeds by zero order, in the worst direction of feed, shape (r, s)."""
    rows = replace(draws.rows(1.0, grid.cut.tangential, grid.cut.radial), cut=grid.cut)
    return np.min([MeanForce.of(rows.fed_at(angle)).limits(grid.speeds)[0] for angle in grid.feed_angles], axis=0)


def _shares(limits: Floats, depths: Floats) -> Floats:
    """Share of limits (r, s) that lie beyond each depth (m), shape (s, d)."""
    rising = np.sort(limits, axis=0)
    return np.array([1 - np.searchsorted(column, depths) / len(limits) for column in rising.T])


def _candidates(gain: Floats, speeds: Floats) -> list[tuple[int, int]]:
    """Places of the largest gain, the largest first, none of a speed right beside another."""
    column, taken = np.argmax(gain, axis=1), list[int]()
    for row in np.argsort(-np.max(gain, axis=1)).tolist():
        if all(abs(np.log(speeds[row] / speeds[other])) > APART for other in taken):
            taken.append(row)
        if len(taken) == LOOKED_AT:
            break
    return [(row, int(column[row])) for row in taken]


def _nearby(depth: float, exact: bool) -> list[float]:
    """Depths (m) to look at where zero order promises one; that alone where it is exact."""
    steps = [depth] if exact else [share * depth for share in NEARBY]
    return [round(step * 1e3 / MM) * MM / 1e3 for step in steps if step * 1e3 >= MM]


def _settles(ratios: Mapping[str, Floats], chance: Floats) -> tuple[str, float]:
    """What differs most between the spindles on which a cut chatters and those on which it does not."""
    told = {}
    for name, values in ratios.items():
        chatters, stable = (np.average(values, weights=weight) for weight in (chance, 1 - chance))
        told[name] = float(abs(chatters - stable) / max(np.std(values), 1e-12))
    name = max(told, key=lambda one: told[one])
    return name, told[name]
