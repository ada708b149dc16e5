"""Bands fitted again with each other's tails."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modal.bands.extraction import BandLines, Extraction, FittedBand
from modal.bands.fit_peaks import fit_again
from modal.fitting import beyond_terms

SWEEPS = 4
"""Most rounds over the bands, each with the tails of the other bands' modes as they are then."""
SETTLED = 0.01
"""Change of those tails beyond the residual terms, as a share of what the fit leaves, that is not worth another fit."""


def settle(state: Extraction) -> Extraction:
    """Bands fitted again, where their weights are others, and until the tails of the others' modes stay as they are."""
    for _ in range(SWEEPS):
        before = state.bands
        for band in before:
            state = _with(state, band, _again(state, band))
        if all(new is old for new, old in zip(state.bands, before, strict=False)):
            break
    return state


def _again(state: Extraction, band: FittedBand) -> FittedBand | None:
    """A band fitted to what the modes of all others leave now; the same where that has not changed."""
    data = state.data(band.lines, without=band)
    return band if np.array_equal(data.weight, band.data.weight) and _is_settled(band, data) else fit_again(band, data)


def _is_settled(band: FittedBand, data: BandLines) -> bool:
    """Whether the weighted data of a band has not changed by more than its residual terms take up."""
    off, most = data.own - band.data.own, SETTLED * np.sqrt(band.fit.sum_of_squares)
    if np.linalg.norm(off * data.weight) < most:
        return True
    return bool(np.linalg.norm(beyond_terms(data.frequency, off, data.weight, band.terms)) < most)


def _with(state: Extraction, old: FittedBand, new: FittedBand | None) -> Extraction:
    bands = (new if band is old else band for band in state.bands)
    return state if new is old else replace(state, bands=tuple(band for band in bands if band is not None))
