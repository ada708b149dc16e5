"""All that a program is to the spindle on its way: its engagements, each in every direction of feed that counts."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from lobes import Cut, Direction
from lobewatch.machine import FEED_ANGLES, Machine, ProgramTable
from lobewatch.tool.assembly import Assembly
from lobewatch.tool.mean_lobes import Modes

BETWEEN = 0.5
"""Radial depth over diameter below which a cut in both directions is worst at angles between x and y, always ..."""
ALIKE = (0.02, 0.1, 0.1)
"""... and from which on it is only where f_n, zeta or K in x and y differ by more than this, relatively, or modes lie
askew. Else no angle had a limit more than 3.5 % lower in 148 random cases."""
BOTH: tuple[Direction, ...] = ("down", "up")
"""Directions that a cut may be milled in; a slot is both at once."""
STEP = math.pi / 12
"""Step of the angles between x and y (rad)."""


def ways(table: ProgramTable, machine: Machine, spindle: Assembly, either: bool = False) -> tuple[Cut, ...]:
    """Cuts that a program makes on its way, in no order; either: milled up and down, whatever the table says.

    In a corner the feed turns, whatever axis it follows on the straight.
    """
    differ = not are_alike(spindle.x, spindle.y) or spindle.axes.patterns[0] is not None
    return tuple(
        replace(cut, feed_angle=angle, direction=direction)
        for cut in machine.engaged_cuts(table)
        for direction in (BOTH if either and cut.immersion < 1 else (cut.direction,))
        for angle in _feed_angles(table, cut.immersion, differ)
    )


def _feed_angles(table: ProgramTable, immersion: float, differ: bool) -> tuple[float, ...]:
    """Directions of feed as angles from x (rad): half a turn apart they are alike."""
    if table.feed != "both" and table.corner_radius_mm is None:
        return (FEED_ANGLES[table.feed],)
    if immersion < BETWEEN or differ:
        return tuple(i * STEP for i in range(round(math.pi / STEP)))
    return tuple(FEED_ANGLES.values())


def are_alike(x: Modes, y: Modes) -> bool:
    """Whether the modes of both directions are the same, as those of a round spindle or a direction taken for both."""
    if x is None or y is None or len(x) != len(y):
        return False
    numbers = np.array([[(mode.frequency, mode.damping_ratio, mode.stiffness) for mode in side] for side in (x, y)])
    return bool(np.all(np.abs(numbers[1] / numbers[0] - 1) <= ALIKE))
