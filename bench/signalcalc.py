"""FRFs of SignalCalc files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.io import loadmat

from acquisition import Frf, from_accelerance

STANDARD_GRAVITY = 9.80665


def measured_frfs(file: Path) -> list[Frf]:
    """Accelerances of a SignalCalc file, the frequency in the real part of the first column, with their coherence."""
    table = loadmat(file)
    sensors = [name[3:] for name in table if name.startswith("H1_")]
    return [
        from_accelerance(
            table[f"H1_{sensor}"][:, 0].real,
            STANDARD_GRAVITY * table[f"H1_{sensor}"][:, 1],
            np.clip(table[f"C1_{sensor}"][:, 1].real, 0, 1),
        )
        for sensor in sensors
    ]
