"""Scans as a board prints them, and what is lost between them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

MODULI = (1 << 8, 1 << 16, 1 << 32)
"""Where counters of boards begin anew."""


@dataclass(frozen=True, eq=False)
class Printed:
    """Rows of numbers that came one after the other without a broken one between them."""

    rows: NDArray[np.float64]
    """Numbers, shape (n_scans, n_columns)."""
    broken_before: int = 0
    """Broken lines or frames before them."""


@dataclass(frozen=True, eq=False)
class Run:
    """Consecutive scans."""

    values: NDArray[np.float64]
    """Values as printed, a row a sensor, shape (n_sensors, n_scans)."""
    lost_before: int = 0
    """Scans lost before them: by the counter, else the broken lines or frames, which is the least there can be."""


class ScanCounter:
    """Takes the counter off, where there is one, and tells by it what is lost."""

    def __init__(self, values: int = 2) -> None:
        """values: in a row, beside the counter. No scan has come yet."""
        self._values = values
        self._last: int | None = None
        self._largest = 0

    def runs(self, printed: Printed) -> Iterator[Run]:
        """Runs of consecutive scans in rows of values, or of a counter and values."""
        values = printed.rows[:, -self._values :].T
        if printed.rows.shape[1] == self._values:
            yield Run(values, printed.broken_before)
            return
        counts = printed.rows[:, 0].astype(np.int64)
        lost = self._lost(counts)
        for run in np.split(np.arange(counts.size), np.flatnonzero(lost[1:]) + 1):
            yield Run(values[:, run], int(lost[run[0]]))

    def _lost(self, counts: NDArray[np.int64]) -> NDArray[np.int64]:
        """Scans lost before each row. The counter begins anew at the least modulus above all counts so far."""
        self._largest = max(self._largest, int(counts.max()))
        modulus = next((modulus for modulus in MODULI if modulus > self._largest), MODULI[-1])
        before = counts[0] - 1 if self._last is None else self._last
        self._last = int(counts[-1])
        return (np.diff(counts, prepend=before) - 1) % modulus
