"""How finely semi-discretisation divides the tooth period."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lobes.cut import Cut
from lobes.milling_system import MillingSystem, milling_system
from lobes.speeds import check_speeds
from lobes.tooth_force import interval_forces
from modal import Mode

PER_CYCLE = 60
"""Intervals in one cycle of the fastest mode: multipliers within 0.2 % of the exact ones."""
FEWEST = 40
"""Intervals of a tooth period at least ..."""
IN_CUT = 30
"""... and of the part of it that a tooth spends in the cut, where that is less."""
GROWTH = 1.1
"""Numbers are rounded up to powers of this times the fewest, so that neighbouring speeds share theirs."""


def intervals_needed(
    x: Sequence[Mode] | None, y: Sequence[Mode] | None, cut: Cut, speed_rpm: ArrayLike, depth: float = 0.0
) -> NDArray[np.int64]:
    """Intervals of a tooth period at each speed (rpm), shape (n,), that follow the fastest mode that matters.

    The modes count as stiffened by a cut of this depth (m): f^2 + depth max|H| / (4 pi^2 mass). Modes of less than 1 %
    of the largest flexibility 1 / (2 K zeta) do not count.
    """
    return chosen_intervals(None, milling_system(x, y), cut, check_speeds(speed_rpm), depth)


def chosen_intervals(
    asked: int | None, system: MillingSystem, cut: Cut, speed_rpm: NDArray[np.float64], depth: float
) -> NDArray[np.int64]:
    """The number asked for, or those needed; ValueError for what is no number of intervals."""
    if asked is None:
        return _needed(system, cut, speed_rpm, depth)
    if not (asked >= 1 and asked == int(asked)):
        raise ValueError(f"intervals={asked} is not a whole number >= 1; None chooses it from the fastest mode")
    return np.full(speed_rpm.shape, int(asked))


def _needed(system: MillingSystem, cut: Cut, speed_rpm: NDArray[np.float64], depth: float) -> NDArray[np.int64]:
    force = np.max(np.abs(interval_forces(cut, FEWEST, np.zeros(1))))
    stiffened = system.frequency**2 + depth * force * system.shape**2
    fastest = float(np.sqrt(np.max(stiffened[system.deciding]))) / (2 * np.pi)
    wanted = PER_CYCLE * fastest * 60 / (cut.teeth * speed_rpm)
    fewest = max(FEWEST, IN_CUT / min(cut.teeth_in_cut, 1))
    power = np.ceil(np.log(np.maximum(wanted, fewest) / FEWEST) / np.log(GROWTH) - 1e-9)
    return np.asarray(np.ceil(FEWEST * GROWTH**power - 1e-9), dtype=np.int64)
