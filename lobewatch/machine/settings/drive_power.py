"""Power and torque of the spindle drive: depth limit, and cutting coefficients from measured power."""

import math
from dataclasses import dataclass

import numpy as np

from lobes import Cut, max_depth_for_drive, mean_torque
from lobewatch.arrays import Floats
from lobewatch.machine.settings.cut_tables import CutTable
from lobewatch.machine.settings.machine_file import Machine
from lobewatch.machine.settings.tool_limits import find_feed_per_tooth


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
    if not (math.isfinite(power_kw) and power_kw > 0):
        raise ValueError(f"{option}: is not above 0; give what the drive shows more than in air, in kW")
    if table.feed_per_tooth_mm is None:
        raise ValueError(f"{option}: says nothing without feed_per_tooth_mm; write it into machine.toml")
    if len(table.immersions) > 1:
        unknown = "of a cut whose radial depth changes on its way nobody knows at which it was"
        raise ValueError(f"{option}: {unknown}; leave it out, or read it in a cut with one radial depth")
    if power_kw > machine.drive.power_kw:
        raise ValueError(f"{option}: is more than power_kw={machine.drive.power_kw:g} of [drive]; give kW")
    cut, edge = machine.build_cut(table), machine.coefficients(table).tangential_edge
    diameter, feed = table.tool_diameter_mm / 1e3, table.feed_per_tooth_mm / 1e3
    reading = PowerReading(1e3 * power_kw, cut, depth, diameter, feed, edge)
    expected_kw = reading.expected_power(speed_rpm) / 1e3
    low, high = expected_kw / MAX_POWER_RATIO, expected_kw * MAX_POWER_RATIO
    if not low <= power_kw <= high:
        expected = f"{low:.2g} to {high:.2g} kW are to be expected; give kW, less what is shown in air"
        raise ValueError(f"{option}: with the Kt of {cut.tangential / 1e6:.0f} N/mm2 in machine.toml {expected}")
    return reading
