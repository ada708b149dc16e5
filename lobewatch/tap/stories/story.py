"""How the bearings of an emulated spindle lose stiffness over the months of a story."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import Self

from acquisition import DataError
from dsm import Spindle, calibrate, natural_frequencies
from lobewatch.machine import MachineFolder
from lobewatch.tap.emulated_spindle import with_bearing_stiffness

FALL = 0.10
"""Fall of the first natural frequency over a story that wears the spindle out, as a share; chosen."""
STEP = 0.02
"""Fall at once, halfway, as a share; chosen."""
POWER = 3
"""Power of the time that an accelerating fall goes with; chosen."""
NEW_AT = 0.6
"""Share of the months after which the bearings are replaced; chosen."""
DEEPEST = 0.3
"""Largest fall that is worked out, as a share."""
MOST = 60
"""Months that the truth is looked up in beyond the end of a story."""
HALVINGS = 20
"""Number of halvings of a month, in which the date of a fall is looked for."""


class Story(StrEnum):
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
class Wear:
    """One spindle in one story; months count from 0, the last test is at `months` - 1."""

    new: Spindle
    """Spindle as it was built."""
    fresh: float
    """Stiffness of each bearing when new (N/m)."""
    months: int
    """Length of the story (months)."""
    story: Story
    """Story of the bearings."""

    @classmethod
    def of(cls, folder: MachineFolder, months: int, story: Story) -> Self:
        """The wear of the spindle of a machine; DataError where machine.toml has none."""
        table = folder.machine.spindle
        if table is None:
            raise DataError(f"{folder.toml}: no model to age: add a [spindle] table (or use lobewatch init --example)")
        return cls(table.build(), table.bearing_stiffness_n_per_um * 1e6, months, story)

    @property
    def replaced_at(self) -> int | None:
        """Month before whose tests the bearings are replaced; None where they are not."""
        return math.ceil(NEW_AT * self.months) if self.story is Story.REPLACED and self.months > 1 else None

    def spindle(self, month: float) -> Spindle:
        """The spindle as it is then."""
        return with_bearing_stiffness(self.new, self.bearing_stiffness(month))

    def frequency(self, month: float) -> float:
        """First natural frequency then (Hz)."""
        return float(natural_frequencies(self.spindle(month), 1)[0])

    def bearing_stiffness(self, month: float) -> float:
        """Stiffness of each bearing then (N/m)."""
        fall = self.fall(month)
        return float(calibrate(self.new, (1 - fall) * self._first).bearing_stiffness) if fall else self.fresh

    def fall(self, month: float) -> float:
        """Fall of the first natural frequency since it was new, as a share of it."""
        if self.replaced_at is not None and month >= self.replaced_at:
            month -= self.replaced_at
        share = month / max(self.months - 1, 1)
        falls = {
            Story.STEADY: 1 - (1 - FALL) ** share,
            Story.REPLACED: 1 - (1 - FALL) ** share,
            Story.ACCELERATING: FALL * share**POWER,
            Story.STEP: STEP if month >= self.months / 2 else 0.0,
            Story.NONE: 0.0,
        }
        return float(min(falls[self.story], DEEPEST))

    @cached_property
    def _first(self) -> float:
        """First natural frequency when new (Hz)."""
        return float(natural_frequencies(with_bearing_stiffness(self.new, self.fresh), 1)[0])

    def month_of(self, frequency: float) -> float | None:
        """Month after the last test in which the frequency falls to this (Hz); None where it does not for years."""
        last = self.months - 1
        below = next((month for month in range(last, last + MOST) if self.frequency(month) <= frequency), None)
        if below is None or below == last:
            return below
        low, high = float(below - 1), float(below)
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            low, high = (low, middle) if self.frequency(middle) <= frequency else (middle, high)
        return high
