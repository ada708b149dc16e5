"""The depth of cut that the spindle drive allows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lobes import deepest_for_drive
from lobewatch.machine.settings.cut_tables import CutTable
from lobewatch.machine.settings.known_tool import feed_that_counts
from lobewatch.machine.settings.machine_file import Machine


def drive_limit(machine: Machine, table: CutTable, speed_rpm: NDArray[np.float64]) -> NDArray[np.float64]:
    """Deepest cut (m) of a cut that [drive] allows at each speed (rpm); inf where no feed per tooth is known."""
    feed_mm = feed_that_counts(machine, table)
    if feed_mm is None:
        return np.full(speed_rpm.shape, np.inf)
    edge = machine.coefficients(table).tangential_edge
    return deepest_for_drive(
        machine.build_cut(table),
        speed_rpm,
        table.tool_diameter_mm / 1e3,
        feed_mm / 1e3,
        edge if np.isfinite(edge) else 0.0,
        machine.drive.power_kw * 1e3,
        machine.drive.torque_nm,
    )
