"""The spindle of a machine as it is mounted in one month of a story."""

from __future__ import annotations

import numpy as np

from dsm import Spindle
from lobewatch.machine import MachineFolder
from lobewatch.tap.stories.mounting import Mounting, remounted
from lobewatch.tap.stories.story import Story, Wear


def mounted_at(folder: MachineFolder, story: Story, months: int, month: int, mounting: Mounting, seed: int) -> Spindle:
    """As the tool is mounted then; the same for the same seed. DataError where machine.toml has no spindle."""
    shifts = mounting.shifts(month + 1, 1, np.random.default_rng([seed, month]))
    return remounted(Wear.of(folder, months, story).spindle(month), float(shifts[month, 0]))
