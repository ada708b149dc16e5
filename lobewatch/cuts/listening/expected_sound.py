"""What a cut should sound like at its own speed and depth, by the modes of its tool as they were tapped."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from lobes import milling_system, piece_numbers, rows_of
from lobes.chatter_frequency import chatter_frequency
from lobes.floquet import largest_multipliers
from lobewatch.machine.settings.cut_setting import CutSetting
from lobewatch.machine.settings.cut_tables import FEED_ANGLES
from lobewatch.tool.assembly import Assembly


class ExpectedSound(NamedTuple):
    """What a cut sounds like in the direction of feed that is worst."""

    stable: bool
    """Whether no multiplier reaches 1."""
    frequency: float
    """Frequency of the largest multiplier (Hz): what chatter would sound with at this depth."""


def expected_sound(setting: CutSetting, assembly: Assembly, speed_rpm: float) -> ExpectedSound:
    """What to expect at a speed (rpm): the sound at the limit is more than 1 % off in many cuts far beyond it.

    The multiplier is that of the cut's own depth. ValueError for an assembly without modes.
    """
    system = milling_system(assembly.x, assembly.y, assembly.axes.patterns[0])
    axes = FEED_ANGLES.values() if setting.feed == "both" else (FEED_ANGLES[setting.feed],)
    cuts = [replace(setting.cut, feed_angle=angle) for angle in axes]
    depth, speed = np.array([[setting.depth]]), np.array([speed_rpm])
    multipliers = []
    for cut in cuts:
        rows = rows_of(system, cut, speed)
        multipliers.append(largest_multipliers(rows, depth, piece_numbers(rows, setting.depth))[0])
    worst = int(np.argmax([abs(multiplier[0]) for multiplier in multipliers]))
    repeats = np.array([setting.cut.repeats * speed_rpm / 60])
    frequency = chatter_frequency(system, cuts[worst], multipliers[worst], depth[0], repeats)
    return ExpectedSound(bool(abs(multipliers[worst][0]) < 1), float(frequency[0]))
