"""LSCF poles over all lines of an extraction: what a person chooses further modes from."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from modal.bands.extraction import Array, Extraction
from modal.poles import StabilisationChart, physical_poles

MOST_LINES = 200
"""Most lines of one chart between the bands, few enough for its order."""
NEAR = 0.005
"""Relative distance up to which a pole beside a mode is that mode; chosen."""
FEWEST_LINES = 16
"""Between bands that are nearer to each other than that there is nothing to look for."""


def survey(state: Extraction) -> list[StabilisationChart]:
    """Charts of the bands, and between them those of what the modes of all bands leave."""
    between = [state.data(lines).chart for lines in _gaps(state)]
    return [*(band.data.chart for band in state.bands), *between]


def candidates(state: Extraction) -> Array:
    """Natural frequencies of the poles (Hz) that stay where they are as the order grows and are no modes, rising.

    A mode of the extraction within their half-power half-width, or half a percent, is the same.
    """
    modes = np.array([frequency for band in state.bands for frequency in band.fit.frequency])
    poles = [physical_poles(chart) for chart in survey(state)]
    other = [
        frequency
        for chain in poles
        for frequency, zeta in zip(chain.frequency, chain.damping_ratio, strict=True)
        if np.min(np.abs(modes - frequency), initial=np.inf) > max(zeta, NEAR) * frequency
    ]
    return np.sort(np.array(other))


def _gaps(state: Extraction) -> Iterator[slice]:
    """Lines outside all bands, in parts."""
    start = 0
    ends = [*((band.lines.start, band.lines.stop) for band in state.bands), (state.frf.frequency.size,) * 2]
    for stop, following in ends:
        if stop - start >= FEWEST_LINES:
            borders = np.linspace(start, stop, -(-(stop - start) // MOST_LINES) + 1).astype(int)
            yield from (slice(*pair) for pair in zip(borders[:-1].tolist(), borders[1:].tolist(), strict=True))
        start = max(start, following)
