"""Wear scenarios of an emulated spindle: bearing stiffness, reclamping and temperature."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from acquisition import DataError
from dsm import Spindle, calibrate, natural_frequencies
from lobewatch.machine import MachineFolder
from lobewatch.monitoring.level_model import STEEL_FREQUENCY_PER_KELVIN
from lobewatch.tap.emulated_spindle import set_bearing_stiffness

SCENARIO_DROP = 0.10
"""Fall of the first natural frequency over a story that wears the spindle out, as a share; chosen."""
STEP_DROP = 0.02
"""Fall at once, halfway, as a share; chosen."""
ACCELERATION_EXPONENT = 3
"""Power of the time that an accelerating fall goes with; chosen."""
REPLACEMENT_SHARE = 0.6
"""Share of the months after which the bearings are replaced; chosen."""
MAX_SCENARIO_DROP = 0.3
"""Largest fall that is worked out, as a share."""
MAX_FORECAST_MONTHS = 60
"""Months that the truth is looked up in beyond the end of a story."""
MONTH_BISECTIONS = 20
"""Number of halvings of a month, in which the date of a fall is looked for."""


class WearScenario(StrEnum):
    """Stories of the bearings."""

    STEADY = "steady"
    """The first natural frequency falls by the same share every month."""
    STEP = "step"
    """They lose some at once, halfway, and no more."""
    ACCELERATING = "accelerating"
    """They lose more and more."""
    REPLACED = "replaced"
    """As steady, and are replaced when more than half of the story is over."""
    NONE = "none"
    """Nothing."""


@dataclass(frozen=True)
class SpindleWear:
    """One spindle in one story; months count from 0, the last test is at `months` - 1."""

    new: Spindle
    """Spindle as it was built."""
    new_bearing_stiffness: float
    """Stiffness of each bearing when new (N/m)."""
    months: int
    """Length of the story (months)."""
    scenario: WearScenario
    """Story of the bearings."""

    @classmethod
    def of(cls, folder: MachineFolder, months: int, story: WearScenario) -> Self:
        """The wear of the spindle of a machine; DataError where machine.toml has none."""
        table = folder.machine.spindle
        if table is None:
            raise DataError(f"{folder.toml}: no model to age: add a [spindle] table (or use lobewatch init --example)")
        return cls(table.build(), table.bearing_stiffness_n_per_um * 1e6, months, story)

    @property
    def replaced_at(self) -> int | None:
        """Month before whose tests the bearings are replaced; None where they are not."""
        return (
            math.ceil(REPLACEMENT_SHARE * self.months)
            if self.scenario is WearScenario.REPLACED and self.months > 1
            else None
        )

    def spindle(self, month: float) -> Spindle:
        """The spindle as it is then."""
        return set_bearing_stiffness(self.new, self.bearing_stiffness(month))

    def frequency(self, month: float) -> float:
        """First natural frequency then (Hz)."""
        return float(natural_frequencies(self.spindle(month), 1)[0])

    def bearing_stiffness(self, month: float) -> float:
        """Stiffness of each bearing then (N/m)."""
        fall = self.frequency_drop(month)
        return (
            float(calibrate(self.new, (1 - fall) * self._first).bearing_stiffness)
            if fall
            else self.new_bearing_stiffness
        )

    def frequency_drop(self, month: float) -> float:
        """Fall of the first natural frequency since it was new, as a share of it."""
        if self.replaced_at is not None and month >= self.replaced_at:
            month -= self.replaced_at
        share = month / max(self.months - 1, 1)
        falls = {
            WearScenario.STEADY: 1 - (1 - SCENARIO_DROP) ** share,
            WearScenario.REPLACED: 1 - (1 - SCENARIO_DROP) ** share,
            WearScenario.ACCELERATING: SCENARIO_DROP * share**ACCELERATION_EXPONENT,
            WearScenario.STEP: STEP_DROP if month >= self.months / 2 else 0.0,
            WearScenario.NONE: 0.0,
        }
        return float(min(falls[self.scenario], MAX_SCENARIO_DROP))

    @cached_property
    def _first(self) -> float:
        """First natural frequency when new (Hz)."""
        return float(natural_frequencies(set_bearing_stiffness(self.new, self.new_bearing_stiffness), 1)[0])

    def find_month(self, frequency: float) -> float | None:
        """Month after the last test in which the frequency falls to this (Hz); None where it does not for years."""
        last = self.months - 1
        below = next(
            (month for month in range(last, last + MAX_FORECAST_MONTHS) if self.frequency(month) <= frequency), None
        )
        if below is None or below == last:
            return below
        low, high = float(below - 1), float(below)
        for _ in range(MONTH_BISECTIONS):
            middle = (low + high) / 2
            low, high = (low, middle) if self.frequency(middle) <= frequency else (middle, high)
        return high


BAD_CLAMPING_DROP = 0.02
"""Share that a bad clamping takes from the frequency; chosen."""
MEAN_SPINDLE_TEMPERATURE = 22.0
"""Temperature of the spindle about which the year swings (degC); chosen."""
MONTHS_PER_YEAR = 12.0
"""Length of a year (months)."""

Floats = NDArray[np.float64]


class MountingVariation(NamedTuple):
    """Differences between tests."""

    scatter: float = 0.0
    """Standard deviation of the frequency by remounting, as a share of it (-)."""
    bad_share: float = 0.0
    """Share of tests that are clamped badly (-)."""
    temperature_swing: float | None = None
    """Half the difference of the spindle's temperature between summer and winter (K); None where none is recorded."""

    def check(self) -> None:
        """ValueError for what cannot be."""
        if not 0 <= self.scatter <= 0.05:
            raise ValueError(f"--scatter {100 * self.scatter:g} is not between 0 and 5 %")
        if not 0 <= self.bad_share <= 0.5:
            raise ValueError(f"--bad-clampings {100 * self.bad_share:g} is not between 0 and 50 %")
        if self.temperature_swing is not None and not 0 <= self.temperature_swing <= 30:
            raise ValueError(f"--temperature {self.temperature_swing:g} is not between 0 and 30 K")

    def temperatures(self, months: int) -> Floats | None:
        """Temperature of the spindle in each month, the first in winter (degC), shape (months,)."""
        if self.temperature_swing is None:
            return None
        return np.asarray(
            MEAN_SPINDLE_TEMPERATURE
            - self.temperature_swing * np.cos(2 * math.pi * np.arange(months) / MONTHS_PER_YEAR)
        )

    def shifts(self, months: int, tests: int, random: np.random.Generator) -> Floats:
        """Shift of the frequency, as a share of it, shape (months, tests)."""
        shifts = random.normal(scale=self.scatter, size=(months, tests))
        if self.bad_share:
            shifts -= BAD_CLAMPING_DROP * (random.random((months, tests)) < self.bad_share)
        warmth = self.temperatures(months)
        return (
            shifts
            if warmth is None
            else shifts + STEEL_FREQUENCY_PER_KELVIN / 100 * (warmth - MEAN_SPINDLE_TEMPERATURE)[:, np.newaxis]
        )


def remount_spindle(spindle: Spindle, shift: float) -> Spindle:
    """The spindle with bearings that put its frequency where mounting has moved it, by a share of it."""
    return calibrate(spindle, (1 + shift) * float(natural_frequencies(spindle, 1)[0])).spindle


def build_mounted_spindle(
    folder: MachineFolder, story: WearScenario, months: int, month: int, mounting: MountingVariation, seed: int
) -> Spindle:
    """The spindle as it is mounted in one month of a story, the same for the same seed.

    DataError where machine.toml has no spindle.
    """
    shifts = mounting.shifts(month + 1, 1, np.random.default_rng([seed, month]))
    return remount_spindle(SpindleWear.of(folder, months, story).spindle(month), float(shifts[month, 0]))
