"""How much the speed of a spindle varies in a cut, from its own multiples in parts of it."""

from __future__ import annotations

import numpy as np

from lobewatch.cuts.listening.lattice import SpindleSpeed
from lobewatch.cuts.listening.spectrum import Floats, SpectralLines, lines_of, spectrum_of

PARTS = 4
"""Parts that a cut is divided into."""
LOUDEST = 8
"""Multiples that are looked at."""
MOST = 2e-3
"""Largest change that is looked for, relative."""
LEAST = 1e-4
"""Change that every spindle varies by, relative; chosen."""
WIDER = 3.0
"""Change of the speed over that of the means of the parts: within a part it varies too; chosen."""
AGREEING = 3
"""Multiples that must have changed alike."""


def unsteadiness(signal: Floats, sample_rate: float, lines: SpectralLines, turning: SpindleSpeed, bin_: float) -> float:
    """By how much the speed varies, relative; signal of the cut, its lines and their bin (Hz)."""
    order = np.round(lines.frequency / turning.frequency)
    comb = (np.abs(lines.frequency - order * turning.frequency) < bin_ + MOST * lines.frequency / WIDER) & (order > 1)
    loudest = lines[comb].loudest(LOUDEST)
    if not len(loudest):
        return LEAST
    orders = np.round(loudest.frequency / turning.frequency)
    changes = []
    for part in np.array_split(signal, PARTS):
        heard = lines_of(spectrum_of(part, sample_rate)).frequency
        if heard.size:
            nearest = heard[np.argmin(np.abs(heard[:, np.newaxis] - orders * turning.frequency), axis=0)]
            changes.append(_change(nearest / (orders * turning.frequency) - 1))
    return max(LEAST, min(WIDER * max(changes, default=0.0), MOST))


def _change(off: Floats) -> float:
    """Change of the speed in one part: what most of its multiples agree on, else 0; off: of each, relative."""
    near = off[np.abs(off) < MOST]
    if near.size < max(AGREEING, off.size / 2):
        return 0.0
    low, middle, high = np.quantile(near, [0.25, 0.5, 0.75])
    return abs(float(middle)) if high - low < abs(middle) else 0.0
