"""Limits of a chatter loop whose teeth are unevenly spaced, known over frequency."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from lobes.cut import Cut
from lobes.tip_response import TipResponse
from lobes.tooth_force import mean_regeneration

QUIET = 0.02
"""Share of its largest value below which a response is not looked at."""
PER_WAVE = 24
"""Frequencies in which the regeneration of the longest delay turns once, at least."""
STEPS = 6
"""Of the false position that refines a crossing."""
AT_ONCE = 2_000_000
"""Speeds times frequencies that are worked on at once."""

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


def uneven_limits(branch: TipResponse, cut: Cut, tooth_frequency: Floats) -> tuple[Floats, Floats]:
    """Lowest limit (m) and its frequency (Hz) at each mean tooth frequency (Hz), shape (n,); inf and nan if none.

    b L s = -1 with s = 1 - exp(-i w tau) in the mean over the teeth: b = -1 / Re(L s) where Im(L s) = 0, Re(L s) < 0.
    Source: Budak, An analytical design method for milling cutters with nonconstant pitch to increase stability,
    J. Manuf. Sci. Eng. 125 (2003) 29-34.
    """
    depth, chatter = np.full(tooth_frequency.shape, np.inf), np.full(tooth_frequency.shape, np.nan)
    for rows, grid in _blocks(branch, cut, tooth_frequency):
        loop = branch.receptance(grid) * mean_regeneration(cut, grid / tooth_frequency[rows, np.newaxis])
        row, step = np.nonzero((loop.imag[:, 1:] < 0) != (loop.imag[:, :-1] < 0))
        frequency = _refined(branch, cut, tooth_frequency[rows][row], grid[step], grid[step + 1])
        real = _loop(branch, cut, tooth_frequency[rows][row], frequency).real
        limit = np.where(real < 0, -1 / np.minimum(real, -1e-300), np.inf)
        order = np.lexsort((limit, row))
        first = order[np.flatnonzero(np.diff(row[order], prepend=-1))]
        limited = first[np.isfinite(limit[first])]
        depth[rows[row[limited]]], chatter[rows[row[limited]]] = limit[limited], frequency[limited]
    return depth, chatter


def _blocks(branch: TipResponse, cut: Cut, tooth_frequency: Floats) -> Iterator[tuple[NDArray[np.intp], Floats]]:
    """Speeds and the frequencies to look at for them (Hz)."""
    size = np.abs(branch.on_grid)
    loud = branch.grid[size > QUIET * np.max(size)]
    longest = max(cut.delays) / (2 * np.pi) * cut.teeth
    order = np.argsort(tooth_frequency)
    for part in np.array_split(order, max(1, order.size // 32)):
        step = tooth_frequency[part[0]] / longest / PER_WAVE
        even = np.arange(max(loud[0], step / PER_WAVE), loud[-1], step)
        grid = np.union1d(even, loud[loud > 0])
        for rows in np.array_split(part, -(-part.size * grid.size // AT_ONCE)):
            yield rows, grid


def _loop(branch: TipResponse, cut: Cut, tooth_frequency: Floats, frequency: Floats) -> Complexes:
    return np.asarray(branch.receptance(frequency) * mean_regeneration(cut, frequency / tooth_frequency))


def _refined(branch: TipResponse, cut: Cut, tooth_frequency: Floats, low: Floats, high: Floats) -> Floats:
    """Frequencies between `low` and `high` (Hz) at which the loop is real."""
    at_low = _loop(branch, cut, tooth_frequency, low).imag
    at_high = _loop(branch, cut, tooth_frequency, high).imag
    for _ in range(STEPS):
        middle = high - at_high * (high - low) / (at_high - at_low)
        value = _loop(branch, cut, tooth_frequency, middle).imag
        before = (value < 0) != (at_high < 0)
        low, at_low = np.where(before, middle, low), np.where(before, value, at_low)
        high, at_high = np.where(before, high, middle), np.where(before, at_high, value)
    return np.asarray(np.where(np.abs(at_low) < np.abs(at_high), low, high))
