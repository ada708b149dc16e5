"""Lines of a cut as a lattice: multiples of the spindle frequency, and chatter beside them with the same spacing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lobewatch.cuts.listening.spectrum import Floats, SpectralLines

FAMILIES = 4
"""Frequencies that are no multiples, with their side bands."""
ERROR = 0.3
"""Of the frequency of a line over the root of its clearness (bins) ..."""
LEAST_ERROR = 0.03
"""... and at least (bins)."""
STRAY = 10.0
"""Standard errors that a line is away that does not belong to the lattice."""


@dataclass(frozen=True, eq=False)
class Family:
    """Lines at sign * r + k f, f the frequency of the spindle."""

    which: NDArray[np.intp]
    """Which lines, shape (n,)."""
    sign: Floats
    """Shape (n,); 0 where r is 0."""
    order: Floats
    """k, shape (n,)."""


@dataclass(frozen=True)
class SpindleSpeed:
    """How fast the spindle turns."""

    frequency: float
    """Turns a second (Hz)."""
    error: float
    """Standard error (Hz); inf where it does not follow from several lines."""
    share: float
    """Of all lines looked at, those that it explains."""
    agreeing: int
    """Lines that agree on it, beyond those that it is worked out from."""
    misfit: float
    """Mean square distance of all lines from it, in standard errors of each, at most `STRAY` squared."""


def refine_speed(frequency: float, lines: SpectralLines, bin_: float) -> SpindleSpeed:
    """A spindle frequency (Hz) made exact by least squares over its lattice; bin_: of the spectrum (Hz)."""
    found = SpindleSpeed(frequency, np.inf, 0.0, 0, STRAY**2)
    for tolerance in (1.2, 0.6, 0.6, 0.6):
        families = find_families(found.frequency, lines, tolerance * bin_)
        rows = np.concatenate([_rows(family, number, len(families)) for number, family in enumerate(families)])
        which = np.concatenate([family.which for family in families])
        if np.linalg.matrix_rank(rows) < len(families):
            return found
        root = 1 / (bin_ * np.hypot(ERROR / np.sqrt(lines.clearness[which]), LEAST_ERROR))
        scaled, heard = rows * root[:, np.newaxis], lines.frequency[which] * root
        solution = np.linalg.lstsq(scaled, heard, rcond=None)[0]
        if abs(solution[0] / frequency - 1) > 0.005:
            return found
        error = float(np.sqrt(np.linalg.inv(scaled.T @ scaled)[0, 0]))
        away = np.minimum(np.abs(scaled @ solution - heard), STRAY)
        misfit = float(np.sum(away**2) + (len(lines) - which.size) * STRAY**2) / len(lines)
        found = SpindleSpeed(float(solution[0]), error, which.size / len(lines), which.size - len(families), misfit)
    return found


def find_families(frequency: float, lines: SpectralLines, tolerance: float) -> list[Family]:
    """Multiples of a frequency (Hz), then the families of the clearest lines that are left; tolerance in Hz."""
    heard = lines.frequency
    order = np.round(heard / frequency)
    comb = (np.abs(heard - order * frequency) < tolerance) & (order > 0)
    found = [Family(np.flatnonzero(comb), np.zeros(int(comb.sum())), order[comb])]
    left = ~comb
    for _ in range(FAMILIES):
        if not np.any(left):
            break
        anchor = heard[np.flatnonzero(left)[np.argmax(lines.clearness[left])]]
        up, down = np.round((heard - anchor) / frequency), np.round((heard + anchor) / frequency)
        away, mirrored = np.abs(heard - anchor - up * frequency), np.abs(heard + anchor - down * frequency)
        mine = left & (np.minimum(away, mirrored) < tolerance)
        sign = np.where(away <= mirrored, 1.0, -1.0)
        if np.count_nonzero(mine) > 1:
            found.append(Family(np.flatnonzero(mine), sign[mine], np.where(sign > 0, up, down)[mine]))
        left &= ~mine
    return found


def _rows(family: Family, number: int, count: int) -> Floats:
    """What its lines say of f and of the r of each family, shape (n, count)."""
    rows = np.zeros((family.which.size, count))
    rows[:, number] = family.sign
    rows[:, 0] = family.order
    return rows
