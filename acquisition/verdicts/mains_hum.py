"""Mains hum in the response of a hit: a steady tone that was there before it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from acquisition.hit import Hit

MAINS = (50.0, 60.0)
"""Frequencies of the mains (Hz)."""
HARMONICS = 5
"""Multiples of them that hum has."""
TAIL = 0.2
"""Share of the record at its end that hum is looked for in."""
EXPLAINED = 0.5
"""Share of the variance that hum leaves at most, before the hit and at the end of the record."""
FEWEST = 8
"""Samples before the hit that are too few to tell."""


def mains_hum(hit: Hit, before: int) -> NDArray[np.float64] | None:
    """Tones at 50 or 60 Hz and their multiples in the response (m/s^2), shape (n,); None where there is no hum.

    before: samples that stand before the hit. Hum goes on through the hit with one phase: the same tones must stand in
    these samples and in the last fifth of the record, and be most of what is there. What rings after the hit was not
    there before it.
    """
    quiet, tail = slice(0, before), slice(int((1 - TAIL) * hit.acceleration.size), None)
    if before < FEWEST:
        return None
    tones = (_tones(hit, mains, quiet, tail) for mains in MAINS)
    fitting = [tone for tone in tones if all(_is_most_of(tone, hit.acceleration, part) for part in (quiet, tail))]
    return min(fitting, key=lambda tone: float(np.var((hit.acceleration - tone)[tail])), default=None)


def sounds_like_hum(hit: Hit) -> bool:
    """Whether the last two fifths of the response are mostly steady tones at multiples of the mains, proved or not."""
    size = hit.acceleration.size
    last, last_two = slice(int((1 - TAIL) * size), None), slice(int((1 - 2 * TAIL) * size), None)
    tones = (_tones(hit, mains, last_two) for mains in MAINS)
    return any(_is_most_of(tone, hit.acceleration, last) for tone in tones)


def _tones(hit: Hit, mains: float, *parts: slice) -> NDArray[np.float64]:
    """Multiples of this frequency (Hz) that fit these parts together, over the whole record."""
    angle = (
        2 * np.pi * mains * np.arange(1, HARMONICS + 1) * (np.arange(hit.acceleration.size) / hit.sample_rate)[:, None]
    )
    waves = np.hstack([np.cos(angle), np.sin(angle)])
    known = np.concatenate([waves[part] for part in parts])
    columns = np.column_stack([known, np.ones(len(known))])
    values = np.concatenate([hit.acceleration[part] for part in parts])
    return np.asarray(waves @ np.linalg.lstsq(columns, values, rcond=None)[0][:-1])


def _is_most_of(tone: NDArray[np.float64], signal: NDArray[np.float64], part: slice) -> bool:
    return bool(np.var((signal - tone)[part]) <= EXPLAINED * np.var(signal[part]))
