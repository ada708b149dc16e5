"""Bands fitted again with each other's tails."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modal.bands.extraction import Extraction, FittedBand
from modal.bands.fit_peaks import fit_again

SWEEPS = 4
"""Most rounds over the bands, each with the tails of the other bands' modes as they are then."""
SETTLED = 0.01
"""Change of those tails, as a share of what the fit leaves, that is not worth another fit."""


def settle(state: Extraction, everything: bool = False) -> Extraction:
    """Bands fitted again until the tails of the others' modes stay as they are; everything: each one at least once."""
    for sweep in range(SWEEPS):
        before = state.bands
        for band in before:
            state = _with(state, band, _again(state, band, everything and sweep == 0))
        if all(new is old for new, old in zip(state.bands, before, strict=False)):
            break
    return state


def _again(state: Extraction, band: FittedBand, anyway: bool) -> FittedBand | None:
    """A band fitted to what the modes of all others leave now; the same where that has not changed."""
    data = state.data(band.lines, without=band)
    change = np.linalg.norm((data.own - band.data.own) * data.weight)
    return fit_again(band, data) if anyway or change**2 >= SETTLED**2 * band.fit.sum_of_squares else band


def _with(state: Extraction, old: FittedBand, new: FittedBand | None) -> Extraction:
    bands = (new if band is old else band for band in state.bands)
    return state if new is old else replace(state, bands=tuple(band for band in bands if band is not None))
