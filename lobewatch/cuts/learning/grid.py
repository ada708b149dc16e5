"""Speeds and depths that a test cut may be chosen from."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lobes import Cut, lowest_of, stability_boundary, zero_order
from lobewatch.cuts.learning.cut_evidence import CutEvidence
from lobewatch.machine.journal.heard_cut import CutWord
from lobewatch.verdicts.mean_force import is_constant
from modal import Mode

STEP = 0.008
"""Relative step of the speeds that are looked at."""
RPM, MM = 10.0, 0.05
"""Steps that can be set at a machine (rpm and mm)."""
ROUNDING = 1e-6
"""Share of a step of depth that rounding of numbers may miss."""
SPEEDS = 80
"""Number of speeds at which zero order is compared with semi-discretisation."""
SHARES = (0.1, 3.0)
"""Least and largest ratio of true limit to zero order that is believed; chosen."""

Tip = Sequence[Mode] | None
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
    """Depth that tool and drive allow at each (m), shape (s,)."""
    trust: Floats
    """True limit in the middle over that by zero order, at each speed, shape (s,)."""

    def holds(self, speed: float) -> bool:
        """Whether a speed (rpm) lies within, as far as a heard one may be off."""
        return bool(self.speeds[0] * (1 - STEP) <= speed <= self.speeds[-1] * (1 + STEP))

    def evidence(self, speed: float, depth: float, word: CutWord = "stable") -> CutEvidence:
        """A cut of it."""
        return CutEvidence(self.cut, speed, depth, word, feed_angles=self.feed_angles)


def speeds_between(low: float, high: float) -> Floats:
    """Speeds that can be set (rpm), in steps of 0.8 % and of 10 rpm."""
    number = max(int(np.log(high / low) / STEP) + 1, 2)
    return np.unique(np.clip(np.round(np.geomspace(low, high, number) / RPM) * RPM, low, high))


def floor_depth(depth: float) -> float:
    """The deepest depth (m) that can be set and is not deeper."""
    return round(math.floor(depth * 1e3 / MM + ROUNDING) * MM, 6) / 1e3


def zero_order_trust(
    x: Tip, y: Tip, cut: Cut, feed_angles: tuple[float, ...], speeds: Floats, deepest: float
) -> Floats:
    """True limit over that by zero order at speeds (rpm), shape (s,); 1 where neither is less than a depth (m).

    x and y: modes of the spindle in the middle. Semi-discretisation at fewer speeds, between them interpolated.
    """
    if is_constant(cut):
        return np.ones(speeds.shape)
    cuts = [replace(cut, feed_angle=angle) for angle in feed_angles]
    compared = np.unique(speeds[np.linspace(0, speeds.size - 1, min(SPEEDS, speeds.size)).astype(int)])
    true = lowest_of([stability_boundary(x, y, fed, compared, deepest) for fed in cuts]).depth
    mean = lowest_of([zero_order(x, y, fed, compared) for fed in cuts]).depth
    share = np.minimum(true, deepest) / np.minimum(mean, deepest)
    return np.asarray(np.interp(speeds, compared, np.clip(share, *SHARES)))
