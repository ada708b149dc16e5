"""Units as they stand in the headings of recorded files, and their way to SI."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquisition.errors import DataError
from acquisition.hit import Hit

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


def hit_from(path: Path, columns: Sequence[tuple[str, NDArray[np.float64]]], sample_rate: float) -> Hit:
    """The hit in columns of known unit; DataError unless there is one force and one acceleration, all finite."""
    signals: dict[str, NDArray[np.float64]] = {}
    for unit, values in columns:
        quantity, factor = FACTORS.get(unit.strip().lower(), ("", 0.0))
        if not quantity:
            raise DataError(f"{path}: unit {unit!r} is not known; known are {', '.join(FACTORS)}")
        if quantity in signals:
            raise DataError(f"{path}: two columns are {quantity}; one force and one acceleration are needed")
        signals[quantity] = values * factor
    missing = {"force", "acceleration"} - set(signals)
    if missing:
        units = ", ".join(unit for unit, _ in columns)
        raise DataError(f"{path}: no {' and no '.join(sorted(missing))} channel (units {units})")
    try:
        return Hit(signals["force"], signals["acceleration"], sample_rate)
    except ValueError as error:
        raise DataError(f"{path}: {error}") from error
