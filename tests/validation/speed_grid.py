"""Speeds of a grid of test cuts between two ends."""

import numpy as np

from lobewatch.arrays import Floats
from lobewatch.cuts.learning.suggestion import SPEED_GRID_STEP
from lobewatch.machine.settings.drive_power import SPEED_STEP_RPM


def list_speeds(low: float, high: float) -> Floats:
    """List the speeds that can be set (rpm), in steps of 0.8 % and of 10 rpm."""
    number = max(int(np.log(high / low) / SPEED_GRID_STEP) + 1, 2)
    speeds = np.round(np.geomspace(low, high, number) / SPEED_STEP_RPM) * SPEED_STEP_RPM
    return np.unique(np.clip(speeds, low, high))
