"""Units as they stand in the headings of recorded files, and their way to SI."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquisition.errors import DataError

STANDARD_GRAVITY = 9.80665
"""m/s^2 per g."""

FACTORS: Mapping[str, tuple[str, float]] = {
    "n": ("force", 1.0),
    "newton": ("force", 1.0),
    "newtons": ("force", 1.0),
    "kn": ("force", 1e3),
    "lbf": ("force", 4.4482216152605),
    "g": ("acceleration", STANDARD_GRAVITY),
    "m/s^2": ("acceleration", 1.0),
    "m/s2": ("acceleration", 1.0),
    "m/s²": ("acceleration", 1.0),
    "m_s2": ("acceleration", 1.0),
    "mm/s^2": ("acceleration", 1e-3),
}
"""Unit label in lower case -> quantity and factor to SI."""


def to_si(path: Path, columns: Mapping[str, NDArray[np.float64]]) -> dict[str, NDArray[np.float64]]:
    """Force (N) and acceleration (m/s^2) out of columns named by their unit; DataError unless there is one of each."""
    signals: dict[str, NDArray[np.float64]] = {}
    for unit, values in columns.items():
        quantity, factor = FACTORS.get(unit.strip().lower(), ("", 0.0))
        if not quantity:
            known = ", ".join(FACTORS)
            raise DataError(f"{path}: unit {unit!r} is not known; known are {known}")
        if quantity in signals:
            raise DataError(f"{path}: two columns are {quantity}; one force and one acceleration are needed")
        signals[quantity] = values * factor
    missing = {"force", "acceleration"} - set(signals)
    if missing:
        raise DataError(f"{path}: no {' and no '.join(sorted(missing))} channel (units {', '.join(columns)})")
    return signals
