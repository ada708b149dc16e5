"""Wear scenarios of an emulated spindle: bearing stiffness, reclamping and temperature."""

import math
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np

from dsm import Spindle, calibrate, natural_frequencies
from lobewatch.arrays import Floats
from lobewatch.machine import MachineFolder
from lobewatch.monitoring.level_model import STEEL_FREQUENCY_PER_KELVIN
from lobewatch.tap.emulated_spindle import get_spindle_table, set_bearing_stiffness

SCENARIO_DROP = 0.10
"""Relative drop of f1 over a scenario that wears the spindle out, chosen."""
STEP_DROP = 0.02
"""Relative drop of f1 at once, halfway, chosen."""
ACCELERATION_EXPONENT = 3
"""Exponent of time of an accelerating drop, chosen."""
REPLACEMENT_SHARE = 0.6
"""Share of the months after which the bearings are replaced, chosen."""
MAX_SCENARIO_DROP = 0.3
"""Largest relative drop that is computed."""
MAX_FORECAST_MONTHS = 60
"""Months beyond the end of a scenario in which the truth is searched."""
MONTH_BISECTIONS = 20
"""Number of bisections of a month in the search for the date of a drop."""


class WearScenario(StrEnum):
    """Wear scenario of the bearings."""

    STEADY = "steady"
    """f1 drops by the same share every month."""
    STEP = "step"
    """f1 drops at once, halfway, and no more."""
    ACCELERATING = "accelerating"
    """f1 drops faster and faster."""
    REPLACED = "replaced"
    """f1 drops steadily. The bearings are replaced after more than half of the scenario."""
    NONE = "none"
    """f1 does not change."""


@dataclass(frozen=True)
class SpindleWear:
    """Spindle in a wear scenario. Months count from 0, the last test is at `months` - 1."""

    new: Spindle
    """Spindle as built."""
    new_bearing_stiffness: float
    """Stiffness of each bearing when new (N/m)."""
    months: int
    """Length of the scenario (months)."""
    scenario: WearScenario
    """Wear scenario of the bearings."""

    @classmethod
    def of(cls, folder: MachineFolder, months: int, story: WearScenario) -> Self:
        """Return the wear of the spindle of a machine. DataError if machine.toml has none."""
        table = get_spindle_table(folder, "age")
        return cls(table.build(), table.bearing_stiffness_n_per_um * 1e6, months, story)

    @property
    def replaced_at(self) -> int | None:
        """Month before whose tests the bearings are replaced, None if they are not."""
        is_replaced = self.scenario is WearScenario.REPLACED and self.months > 1
        return math.ceil(REPLACEMENT_SHARE * self.months) if is_replaced else None

    def spindle(self, month: float) -> Spindle:
        """Return the spindle in a month."""
        return set_bearing_stiffness(self.new, self.bearing_stiffness(month))

    def frequency(self, month: float) -> float:
        """Return f1 in a month (Hz)."""
        return float(natural_frequencies(self.spindle(month), 1)[0])

    def bearing_stiffness(self, month: float) -> float:
        """Return the stiffness of each bearing in a month (N/m)."""
        if not (drop := self.frequency_drop(month)):
            return self.new_bearing_stiffness
        return float(calibrate(self.new, (1 - drop) * self._first).bearing_stiffness)

    def frequency_drop(self, month: float) -> float:
        """Return the relative drop of f1 since the spindle was new."""
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
        """f1 when new (Hz)."""
        return float(natural_frequencies(set_bearing_stiffness(self.new, self.new_bearing_stiffness), 1)[0])

    def find_month(self, frequency: float) -> float | None:
        """Return the month after the last test in which f1 drops to a frequency (Hz). None if not for years."""
        last = self.months - 1
        months = range(last, last + MAX_FORECAST_MONTHS)
        below = next((month for month in months if self.frequency(month) <= frequency), None)
        if below is None or below == last:
            return below
        low, high = float(below - 1), float(below)
        for _ in range(MONTH_BISECTIONS):
            middle = (low + high) / 2
            low, high = (low, middle) if self.frequency(middle) <= frequency else (middle, high)
        return high


BAD_CLAMPING_DROP = 0.02
"""Relative drop of f1 by a bad clamping, chosen."""
MEAN_SPINDLE_TEMPERATURE = 22.0
"""Yearly mean of the spindle temperature (degC), chosen."""
MONTHS_PER_YEAR = 12.0
"""Length of a year (months)."""


class MountingVariation(NamedTuple):
    """Variation between tests by reclamping and temperature."""

    scatter: float = 0.0
    """Standard deviation of f1 by reclamping, relative (-)."""
    bad_share: float = 0.0
    """Share of tests with a bad clamping (-)."""
    temperature_swing: float | None = None
    """Half the temperature difference of the spindle between summer and winter (K), None if not recorded."""

    def check(self) -> None:
        """Raise ValueError for impossible values."""
        checks = (
            ("scatter", 100 * self.scatter, 5, "%"),
            ("bad_share", 100 * self.bad_share, 50, "%"),
            ("temperature_swing", self.temperature_swing or 0.0, 30, "K"),
        )
        for name, value, most, unit in checks:
            if not 0 <= value <= most:
                raise ValueError(f"MountingVariation.{name} {value:g} is not between 0 and {most} {unit}")

    def temperatures(self, months: int) -> Floats | None:
        """Return the spindle temperature in each month, the first in winter (degC), shape (months,)."""
        if self.temperature_swing is None:
            return None
        season = np.cos(2 * math.pi * np.arange(months) / MONTHS_PER_YEAR)
        return np.asarray(MEAN_SPINDLE_TEMPERATURE - self.temperature_swing * season)

    def shifts(self, months: int, tests: int, random: np.random.Generator) -> Floats:
        """Draw the relative shifts of f1, shape (months, tests)."""
        shifts = random.normal(scale=self.scatter, size=(months, tests))
        if self.bad_share:
            shifts -= BAD_CLAMPING_DROP * (random.random((months, tests)) < self.bad_share)
        if (warmth := self.temperatures(months)) is None:
            return shifts
        return shifts + STEEL_FREQUENCY_PER_KELVIN / 100 * (warmth - MEAN_SPINDLE_TEMPERATURE)[:, np.newaxis]


def remount_spindle(spindle: Spindle, shift: float) -> Spindle:
    """Return the spindle with bearings that shift f1 by this share, as reclamping does."""
    return calibrate(spindle, (1 + shift) * float(natural_frequencies(spindle, 1)[0])).spindle


def build_mounted_spindle(
    folder: MachineFolder, story: WearScenario, months: int, month: int, mounting: MountingVariation, seed: int
) -> Spindle:
    """Build the spindle as mounted in one month of a scenario, the same for the same seed.

    DataError if machine.toml has no spindle.
    """
    shifts = mounting.shifts(month + 1, 1, np.random.default_rng([seed, month]))
    return remount_spindle(SpindleWear.of(folder, months, story).spindle(month), float(shifts[month, 0]))
