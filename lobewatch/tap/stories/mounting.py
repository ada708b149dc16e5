"""Mounting, clamping and temperature, which move the frequency of an emulated spindle beside its wear."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsm import Spindle, calibrate, natural_frequencies
from lobewatch.decay.series_base import STEEL
from lobewatch.machine import MachineFolder
from lobewatch.tap.stories.story import Story, Wear

BAD = 0.02
"""Share that a bad clamping takes from the frequency; chosen."""
MIDDLE = 22.0
"""Temperature of the spindle about which the year swings (degC); chosen."""
YEAR = 12.0
"""Length of a year (months)."""

Floats = NDArray[np.float64]


class Mounting(NamedTuple):
    """Differences between tests."""

    scatter: float = 0.0
    """Standard deviation of the frequency by remounting, as a share of it (-)."""
    bad: float = 0.0
    """Share of tests that are clamped badly (-)."""
    swing: float | None = None
    """Half the difference of the spindle's temperature between summer and winter (K); None where none is recorded."""

    def check(self) -> None:
        """ValueError for what cannot be."""
        if not 0 <= self.scatter <= 0.05:
            raise ValueError(f"--scatter {100 * self.scatter:g} is not between 0 and 5 %")
        if not 0 <= self.bad <= 0.5:
            raise ValueError(f"--bad-clampings {100 * self.bad:g} is not between 0 and 50 %")
        if self.swing is not None and not 0 <= self.swing <= 30:
            raise ValueError(f"--temperature {self.swing:g} is not between 0 and 30 K")

    def temperatures(self, months: int) -> Floats | None:
        """Temperature of the spindle in each month, the first in winter (degC), shape (months,)."""
        if self.swing is None:
            return None
        return np.asarray(MIDDLE - self.swing * np.cos(2 * math.pi * np.arange(months) / YEAR))

    def shifts(self, months: int, tests: int, random: np.random.Generator) -> Floats:
        """Shift of the frequency, as a share of it, shape (months, tests)."""
        shifts = random.normal(scale=self.scatter, size=(months, tests))
        if self.bad:
            shifts -= BAD * (random.random((months, tests)) < self.bad)
        warmth = self.temperatures(months)
        return shifts if warmth is None else shifts + STEEL / 100 * (warmth - MIDDLE)[:, np.newaxis]


def remounted(spindle: Spindle, shift: float) -> Spindle:
    """The spindle with bearings that put its frequency where mounting has moved it, by a share of it."""
    return calibrate(spindle, (1 + shift) * float(natural_frequencies(spindle, 1)[0])).spindle


def mounted_spindle(
    folder: MachineFolder, story: Story, months: int, month: int, mounting: Mounting, seed: int
) -> Spindle:
    """The spindle as it is mounted in one month of a story, the same for the same seed.

    DataError where machine.toml has no spindle.
    """
    shifts = mounting.shifts(month + 1, 1, np.random.default_rng([seed, month]))
    return remounted(Wear.of(folder, months, story).spindle(month), float(shifts[month, 0]))
