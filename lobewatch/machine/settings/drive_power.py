"""Limits of the spindle drive, the range that machine and tool allow, and cutting coefficients from power."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lobes import Cut, max_depth_for_drive, mean_torque
from lobewatch.arrays import Floats
from lobewatch.machine.settings.cut_tables import CutTable
from lobewatch.machine.settings.machine_file import Machine
from lobewatch.machine.settings.setting_questions import DEPTH_RATIO_RANGE
from lobewatch.machine.settings.tool_limits import ToolLimits, find_feed_per_tooth, find_tool_limits


def drive_depth_limit(machine: Machine, table: CutTable, speed_rpm: Floats) -> Floats:
    """Return the largest depth of cut that the spindle drive allows.

    Parameters
    ----------
    machine
        Machine with its [drive].
    table
        Cut; its own depth is not used.
    speed_rpm
        Spindle speeds (rpm), shape (n,).

    Returns
    -------
    ndarray, shape (n,)
        Axial depth ap (m) at each speed; inf without a feed per tooth.
    """
    feed_mm = find_feed_per_tooth(machine, table)
    if feed_mm is None:
        return np.full(speed_rpm.shape, np.inf)
    edge, drive = machine.coefficients(table).tangential_edge, machine.drive
    diameter, limits = table.tool_diameter_mm / 1e3, (drive.power_kw * 1e3, drive.torque_nm)
    edge = edge if np.isfinite(edge) else 0.0
    return max_depth_for_drive(machine.build_cut(table), speed_rpm, diameter, feed_mm / 1e3, edge, *limits)


DEFAULT_EDGE_LENGTH = 3e-5
"""Kte over Kt (m) if none is published; the middle of the published values, 0.012 to 0.041 mm."""
MAX_POWER_RATIO = 4.0
"""Largest plausible ratio of Kt by power to that of machine.toml, either way; chosen: W in place of kW are 1000
times as much, per cent of load ten times or more."""


@dataclass(frozen=True)
class CutPower:
    """Power of a cut, and the coefficient that follows from it."""

    watts: float
    """Power of the drive in the cut less that in air at the same speed (W)."""
    tangential: float
    """Tangential cutting coefficient Kt by power (Pa)."""
    edge_share: float
    """Power of the edge forces over that of chip formation (-)."""
    edge_known: bool
    """True if Kte is known; otherwise it is `DEFAULT_EDGE_LENGTH` times Kt."""


@dataclass(frozen=True)
class PowerReading:
    """Power shown by a drive, and the cut that caused it."""

    watts: float
    """Power (W)."""
    cut: Cut
    """Cut with the coefficients of machine.toml."""
    depth: float
    """Axial depth of cut ap (m)."""
    diameter: float
    """Tool diameter (m)."""
    feed_per_tooth: float
    """Feed per tooth (m)."""
    tangential_edge: float
    """Edge coefficient Kte (N/m); NaN if unknown."""

    @property
    def edge_coefficient(self) -> float:
        """Edge coefficient Kte, by default proportional to Kt (N/m)."""
        return self.tangential_edge if self.is_edge_known else DEFAULT_EDGE_LENGTH * self.cut.tangential

    @property
    def is_edge_known(self) -> bool:
        """True if Kte is known."""
        return math.isfinite(self.tangential_edge)

    def at(self, speed_rpm: float) -> CutPower:
        """Return the power and Kt at the true speed (rpm)."""
        tangential = self.cut.tangential * self.watts / self.expected_power(speed_rpm)
        share = self._torque(self.edge_coefficient) / self._torque(0.0) - 1
        return CutPower(self.watts, tangential, share, self.is_edge_known)

    def expected_power(self, speed_rpm: float) -> float:
        """Return the power (W) that the coefficients of machine.toml predict."""
        return 2 * np.pi * speed_rpm / 60 * self._torque(self.edge_coefficient)

    def _torque(self, edge: float) -> float:
        """Return the mean torque (N m) for an edge coefficient Kte (N/m)."""
        return float(mean_torque(self.cut, self.depth, self.diameter, self.feed_per_tooth, edge))


def build_power_reading(
    power_kw: float, machine: Machine, table: CutTable, speed_rpm: float, depth: float
) -> PowerReading:
    """Build a power reading from a power above that in air; depth in m.

    Raises ValueError for a power that is implausible or tells nothing about Kt.
    """
    option = f"build_power_reading.power_kw {power_kw:g}"
    cure = "Give the power of the cut minus the power in air, in kW."
    if not (math.isfinite(power_kw) and power_kw > 0):
        raise ValueError(f"{option} is not above 0. {cure}")
    if table.feed_per_tooth_mm is None:
        raise ValueError(f"{option} needs feed_per_tooth_mm. Add this key to machine.toml.")
    if len(table.immersions) > 1:
        unknown = "cannot be used, because the radial depth changes during the cut"
        raise ValueError(f"{option} {unknown}. Leave out the power, or read the power of a cut with one radial depth.")
    if power_kw > machine.drive.power_kw:
        raise ValueError(f"{option} is above power_kw={machine.drive.power_kw:g} of [drive]. {cure}")
    reading = _power_reading(1e3 * power_kw, machine, table, table.feed_per_tooth_mm, depth)
    expected_kw = reading.expected_power(speed_rpm) / 1e3
    low, high = expected_kw / MAX_POWER_RATIO, expected_kw * MAX_POWER_RATIO
    if not low <= power_kw <= high:
        expected = f"the {low:.2g} to {high:.2g} kW expected with Kt {reading.cut.tangential / 1e6:.0f} N/mm2"
        raise ValueError(f"{option} is outside {expected}. {cure}")
    return reading


def _power_reading(
    watts: float, machine: Machine, table: CutTable, feed_per_tooth_mm: float, depth: float
) -> PowerReading:
    edge, diameter = machine.coefficients(table).tangential_edge, table.tool_diameter_mm / 1e3
    return PowerReading(watts, machine.build_cut(table), depth, diameter, feed_per_tooth_mm / 1e3, edge)


def predict_power(machine: Machine, table: CutTable, speed_rpm: float, depth: float) -> CutPower | None:
    """Predict the power of a cut with the coefficients of machine.toml; None without a feed or with several depths.

    Parameters
    ----------
    machine, table
        Machine and cut.
    speed_rpm, depth
        Speed (rpm) and axial depth ap (m).
    """
    if table.feed_per_tooth_mm is None or len(table.immersions) > 1:
        return None
    watts = _power_reading(0.0, machine, table, table.feed_per_tooth_mm, depth).expected_power(speed_rpm)
    return _power_reading(watts, machine, table, table.feed_per_tooth_mm, depth).at(speed_rpm)


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
            return f"{spindle.low_rpm:g}..{spindle.high_rpm:g} rpm, all outside the tool limits"
        is_whole = (self.low_rpm, self.high_rpm) == (spindle.low_rpm, spindle.high_rpm)
        return f"{self.low_rpm:g}..{self.high_rpm:g} rpm{'' if is_whole else ' within the tool limits'}"

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
