"""Power and torque of the spindle drive: depth limit, and cutting coefficients from measured power."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lobes import Cut, CuttingCoefficients, max_depth_for_drive, mean_torque
from lobewatch.machine.settings.cut_tables import CutTable, DriveTable
from lobewatch.machine.settings.machine_file import Machine
from lobewatch.machine.settings.tool_limits import find_feed_per_tooth


def drive_depth_limit(machine: Machine, table: CutTable, speed_rpm: NDArray[np.float64]) -> NDArray[np.float64]:
    """Deepest cut (m) of a cut that [drive] allows at each speed (rpm); inf where no feed per tooth is known."""
    feed_mm = find_feed_per_tooth(machine, table)
    if feed_mm is None:
        return np.full(speed_rpm.shape, np.inf)
    edge = machine.coefficients(table).tangential_edge
    return max_depth_for_drive(
        machine.build_cut(table),
        speed_rpm,
        table.tool_diameter_mm / 1e3,
        feed_mm / 1e3,
        edge if np.isfinite(edge) else 0.0,
        machine.drive.power_kw * 1e3,
        machine.drive.torque_nm,
    )


DEFAULT_EDGE_LENGTH = 3e-5
"""Kte over Kt (m) where none is published; in the middle of those that are, 0.012 to 0.041 mm."""
MAX_POWER_RATIO = 4.0
"""Kt by power over that of machine.toml, or the other way round, from which on it is no such power; chosen: W in place
of kW are 1000 times as much, per cent of load ten times or more."""


@dataclass(frozen=True)
class CutPower:
    """Power of a cut, and what it says."""

    watts: float
    """Power that the drive showed in the cut, less that at the same speed in air (W)."""
    tangential: float
    """Tangential cutting coefficient Kt that it says (Pa)."""
    edge_share: float
    """Power that the edges take for themselves, over that of the chips (-)."""
    edge_known: bool
    """Whether a Kte is known; else it was taken for `DEFAULT_EDGE_LENGTH` times Kt."""


@dataclass(frozen=True)
class PowerReading:
    """Power that a drive shows, and what was cut there as far as it follows from that."""

    watts: float
    """Power (W)."""
    cut: Cut
    """Cut with the coefficients of machine.toml."""
    depth: float
    """Axial depth (m)."""
    diameter: float
    """Diameter of the tool (m)."""
    feed_per_tooth: float
    """Feed per tooth (m)."""
    tangential_edge: float
    """Edge coefficient Kte (N/m); NaN where none is known."""

    @property
    def edge_coefficient(self) -> float:
        """Edge coefficient Kte that is reckoned with (N/m)."""
        return self.tangential_edge if self.is_edge_known else DEFAULT_EDGE_LENGTH * self.cut.tangential

    @property
    def is_edge_known(self) -> bool:
        """Whether a Kte is known."""
        return math.isfinite(self.tangential_edge)

    def at(self, speed_rpm: float) -> CutPower:
        """What it says at the speed that was turned (rpm)."""
        tangential = self.cut.tangential * self.watts / self.expected_power(speed_rpm)
        share = self._torque(self.edge_coefficient) / self._torque(0.0) - 1
        return CutPower(self.watts, tangential, share, self.is_edge_known)

    def expected_power(self, speed_rpm: float) -> float:
        """Power (W) by the coefficients of machine.toml."""
        return 2 * np.pi * speed_rpm / 60 * self._torque(self.edge_coefficient)

    def _torque(self, edge: float) -> float:
        """Mean torque (N m) with this Kte (N/m)."""
        return float(mean_torque(self.cut, self.depth, self.diameter, self.feed_per_tooth, edge))


def build_power_reading(
    power_kw: float,
    table: CutTable,
    known: CuttingCoefficients,
    cut: Cut,
    drive: DriveTable,
    speed_rpm: float,
    depth: float,
) -> PowerReading:
    """A power as a person has read it off; depth in m. ValueError where it says nothing of Kt, and for what is none."""
    if not (math.isfinite(power_kw) and power_kw > 0):
        raise ValueError(f"--power {power_kw:g}: is not above 0; give what the drive shows more than in air, in kW")
    if table.feed_per_tooth_mm is None:
        raise ValueError(f"--power {power_kw:g}: says nothing without feed_per_tooth_mm; write it into machine.toml")
    if len(table.immersions) > 1:
        raise ValueError(
            f"--power {power_kw:g}: of a cut whose radial depth changes on its way nobody knows at which it was; "
            "leave it out, or read it in a cut with one radial depth"
        )
    if power_kw > drive.power_kw:
        raise ValueError(f"--power {power_kw:g}: is more than power_kw={drive.power_kw:g} of [drive]; give kW")
    reading = PowerReading(
        1e3 * power_kw,
        cut,
        depth,
        table.tool_diameter_mm / 1e3,
        table.feed_per_tooth_mm / 1e3,
        known.tangential_edge,
    )
    ends = [reading.expected_power(speed_rpm) / 1e3 * by for by in (1 / MAX_POWER_RATIO, MAX_POWER_RATIO)]
    if not ends[0] <= power_kw <= ends[1]:
        raise ValueError(
            f"--power {power_kw:g}: with the Kt of {cut.tangential / 1e6:.0f} N/mm2 in machine.toml "
            f"{ends[0]:.2g} to {ends[1]:.2g} kW are to be expected; give kW, less what is shown in air"
        )
    return reading
