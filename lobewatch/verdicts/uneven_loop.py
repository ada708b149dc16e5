"""Lowest limits of the loops of many spindles whose teeth are unevenly spaced, known over frequency."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lobes import Cut
from lobes.tooth_force import mean_regeneration

PER_WAVE = 16
"""Frequencies in which the regeneration of the longest delay turns once, at least."""

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


def with_waves(grid: Floats, cut: Cut, teeth: Floats) -> Floats:
    """Frequencies (Hz) (r, k), rising, with as many more as the delays of a cut ask for at tooth frequencies (Hz)."""
    longest = max(cut.delays) * cut.teeth / (2 * np.pi)
    low, high = float(np.min(grid)), float(np.max(grid))
    even = np.arange(low, high, float(np.min(teeth)) / longest / PER_WAVE)
    return np.sort(np.hstack((grid, np.broadcast_to(even, (len(grid), even.size)))), axis=1)


def lowest_uneven(grid: Floats, loop: Complexes, cut: Cut, teeth: Floats) -> tuple[Floats, Floats]:
    """Lowest limit (m) and its frequency (Hz) of loops (r, k) over frequencies (r, k), at tooth frequencies (r, s).

    As `lobes.uneven_limits`: b = -1 / Re(L s) where Im(L s) = 0, between the frequencies on a line; inf and NaN where
    there is none.
    """
    depth, chatter = np.full(teeth.shape, np.inf), np.full(teeth.shape, np.nan)
    for i in range(teeth.shape[1]):
        turned = loop * mean_regeneration(cut, grid / teeth[:, i, np.newaxis])
        before, after = turned[:, :-1], turned[:, 1:]
        crosses = (before.imag < 0) != (after.imag < 0)
        share = before.imag / np.where(crosses, before.imag - after.imag, 1.0)
        real = np.where(crosses, before.real + share * (after.real - before.real), 0.0)
        row, step = np.arange(len(grid)), np.argmin(real, axis=1)
        limited = real[row, step] < 0
        depth[limited, i] = -1 / real[row, step][limited]
        frequency = grid[row, step] + share[row, step] * (grid[row, step + 1] - grid[row, step])
        chatter[limited, i] = frequency[limited]
    return depth, chatter
