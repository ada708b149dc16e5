"""Range of speeds and depths that machine and tool allow, the bounds of recommendations."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lobewatch.arrays import Floats
from lobewatch.machine.settings.cut_tables import CutTable
from lobewatch.machine.settings.drive_power import drive_depth_limit
from lobewatch.machine.settings.machine_file import Machine
from lobewatch.machine.settings.setting_questions import DEPTH_RATIO_RANGE
from lobewatch.machine.settings.tool_limits import ToolLimits, find_tool_limits

SPEED_STEP_RPM, DEPTH_STEP_MM = 10.0, 0.05
"""Steps that can be set at a machine (rpm, mm)."""
STEP_ROUNDING = 1e-6
"""Share of a step that floating-point rounding may miss."""


@dataclass(frozen=True)
class CutRange:
    """Speeds and depths that machine and tool allow for a cut."""

    machine: Machine
    """Machine with its drive."""
    table: CutTable
    """Cut; its own speed and depth are not used."""
    limits: ToolLimits
    """Limits of the tool."""

    @classmethod
    def of(cls, machine: Machine, table: CutTable) -> CutRange:
        """Return the range of a cut."""
        return cls(machine, table, find_tool_limits(machine, table))

    @property
    def low_rpm(self) -> float:
        """Lowest speed (rpm)."""
        low, spindle = self.limits.low_rpm, self.machine.speed.low_rpm
        return low if low == spindle else math.ceil(low / SPEED_STEP_RPM) * SPEED_STEP_RPM

    @property
    def high_rpm(self) -> float:
        """Highest speed (rpm); below `low_rpm` if no speed is allowed."""
        high, spindle = self.limits.high_rpm, self.machine.speed.high_rpm
        return high if high == spindle else math.floor(high / SPEED_STEP_RPM) * SPEED_STEP_RPM

    @property
    def deepest_mm(self) -> float:
        """Largest depth of the tool (mm) that is plausible."""
        return min(self.limits.deepest_mm, DEPTH_RATIO_RANGE[1] * self.table.tool_diameter_mm)

    @property
    def is_empty(self) -> bool:
        """True if no speed is allowed."""
        return self.low_rpm > self.high_rpm

    @property
    def text(self) -> str:
        """Allowed speeds in words."""
        spindle = self.machine.speed
        if self.is_empty:
            return f"{spindle.low_rpm:g}..{spindle.high_rpm:g} rpm, of which the tool bears none"
        is_whole = (self.low_rpm, self.high_rpm) == (spindle.low_rpm, spindle.high_rpm)
        return f"{self.low_rpm:g}..{self.high_rpm:g} rpm{'' if is_whole else ', which the tool bears'}"

    def depth_limits(self, speed_rpm: Floats) -> Floats:
        """Return the largest depth (mm) that tool and drive allow at each speed (rpm)."""
        return np.minimum(self.deepest_mm, 1e3 * drive_depth_limit(self.machine, self.table, speed_rpm))

    def round_down_depth(self, depth_mm: float) -> float:
        """Round a depth (mm) down to a step; 0 if it is implausibly small."""
        floored = round_down_depth_mm(depth_mm)
        return floored if floored >= DEPTH_RATIO_RANGE[0] * self.table.tool_diameter_mm else 0.0

    def contains(self, speed_rpm: float, depth_mm: float) -> bool:
        """Tell whether a speed (rpm) and a depth (mm) are allowed."""
        is_reached = self.low_rpm <= speed_rpm <= self.high_rpm
        return is_reached and depth_mm <= float(self.depth_limits(np.array([speed_rpm]))[0])

    def speeds(self, step: float) -> Floats:
        """Return rising speeds (rpm) that can be set, at least a relative step apart."""
        if self.is_empty:
            return np.empty(0)
        number = int(math.log(self.high_rpm / self.low_rpm) / step) + 2
        wanted = np.round(np.geomspace(self.low_rpm, self.high_rpm, number) / SPEED_STEP_RPM) * SPEED_STEP_RPM
        return np.unique(np.clip(wanted, self.low_rpm, self.high_rpm))


def round_down_depth_mm(depth_mm: float) -> float:
    """Round a depth (mm) down to a step that can be set."""
    return round(math.floor(depth_mm / DEPTH_STEP_MM + STEP_ROUNDING) * DEPTH_STEP_MM, 6)
