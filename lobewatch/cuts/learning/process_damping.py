"""Process damping before the test cuts: range of its coefficient C, and effect of a wear land."""

from typing import NamedTuple

import numpy as np

from lobewatch.arrays import Floats
from lobewatch.machine import CutTable, Machine, ProgramTable

MAX_PROCESS_DAMPING = 5e5
"""Largest C of a material of unknown C (N/m): assumed from quoted values, not checked in a source."""
ABSENT_SHARE = 0.5
"""Share of samples with the lowest C, which is 0 if nothing is known; chosen. So cuts must teach it."""
INDENTATION_STIFFNESS = 3e13
"""Force over the volume that a flank indents (N/m^3), assumed: values as quoted for Ti-6Al-4V, not checked in a source.

Larger ones are quoted for steel (4e13) and aluminium (1.5e14)."""


class ProcessDamping(NamedTuple):
    """Range of the process damping coefficient C, and the cutter."""

    low: float
    """Lowest C (N/m), 0 if unknown."""
    high: float
    """Highest C (N/m)."""
    diameter: float
    """Cutter diameter (m)."""

    @property
    def is_open(self) -> bool:
        """True if test cuts can teach C."""
        return self.high > self.low

    def quantiles(self, share: Floats) -> Floats:
        """Return C (N/m) at probabilities: the lowest with `ABSENT_SHARE`, above it evenly up to the highest."""
        above = np.maximum(share - ABSENT_SHARE, 0.0) / (1 - ABSENT_SHARE)
        return np.asarray(self.low + (self.high - self.low) * above)


NO_PROCESS_DAMPING = ProcessDamping(0.0, 0.0, 1.0)
"""No process damping."""


def find_process_damping(table: CutTable, machine: Machine) -> ProcessDamping:
    """Find the process damping of a cut before the test cuts.

    A wear land of the width l raises the highest C by half the indentation stiffness times l^2, as a flank that moves
    into the surface at v_r indents the volume b l^2 v_r / (2 V). The lowest C stays: test cuts must teach the rest.
    Sources: Chiou & Liang, Int. J. Mach. Tools Manuf. 38 (1998) 1433-1447; Tunc & Budak, Int. J. Mach. Tools Manuf. 57
    (2012) 26-35.

    Parameters
    ----------
    table
        Program or cut.
    machine
        Machine with its materials.
    """
    low, high = machine.process_damping(table)
    land = 1e-6 * (table.wear_land_um or 0.0) if isinstance(table, ProgramTable) else 0.0
    highest = min(high, max(MAX_PROCESS_DAMPING, low)) + INDENTATION_STIFFNESS * land**2 / 2
    return ProcessDamping(low, highest, table.tool_diameter_mm / 1e3)
