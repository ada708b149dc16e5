"""The power that a drive shows in a cut, with errors of its own."""

from __future__ import annotations

import math

import numpy as np

from lobes import Cut
from lobewatch.cuts.learning.cut_likelihood import PowerEvidence, estimate_force_by_power
from lobewatch.machine.settings.drive_power import PowerReading

DIAMETER, FEED, EDGE_LENGTH = 0.016, 1e-4, 2.5e-5
"""Diameter of the tool, feed per tooth and Kte over Kt (m) as machine.toml has them."""
SHOWN, DULL, READ, CHATTERING = (0.85, 1.2), (0.5, 1.5), 0.05, (0.75, 1.0)
"""Power that the drive shows over that of all cuts, Kte over Kt over what machine.toml says, error of each reading, and
power of a cut that chatters over that of a stable one."""


class ShownPower:
    """The drive of one machine, and the edges of one tool."""

    def __init__(self, cut: Cut, tangential: float, random: np.random.Generator) -> None:
        """cut: with the coefficients of machine.toml; tangential: true Kt (Pa).

        Edges rub more where the material is harder, from not at all to as much more as the chips push.
        """
        self.cut, self.random, self.tangential = cut, random, tangential
        self.shown = random.uniform(*SHOWN)
        harder = (tangential / cut.tangential) ** random.uniform()
        self.edge = EDGE_LENGTH * cut.tangential * harder * random.uniform(*DULL)

    def says(self, speed_rpm: float, depth: float, truly_stable: bool, chatters: bool) -> PowerEvidence:
        """Return the power evidence of a slot with its true and its recorded label.

        Kt times the chips removed in a second, and the edges on half of a turn.
        """
        teeth = self.cut.teeth * speed_rpm / 60
        watts = teeth * depth * DIAMETER * (self.tangential * FEED + self.edge * math.pi / 2)
        watts *= self.shown * (1 + READ * self.random.standard_normal())
        watts *= 1.0 if truly_stable else self.random.uniform(*CHATTERING)
        reading = PowerReading(watts, self.cut, depth, DIAMETER, FEED, EDGE_LENGTH * self.cut.tangential)
        return estimate_force_by_power(reading.at(speed_rpm), self.cut, chatters)
