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
LEAST_SHARE = 0.05
"""Own peak of a pole, over the mobility measured there, from which it is worth a look; chosen."""
FEWEST_LINES = 16
"""Between bands that are nearer to each other than that there is nothing to look for."""


def survey(state: Extraction) -> list[StabilisationChart]:
    """Charts of the bands, and between them those of what the modes of all bands leave."""
    between = [state.data(lines).chart for lines in _gaps(state)]
    return [*(band.data.chart for band in state.bands), *between]


def candidates(state: Extraction) -> Array:
    """Natural frequencies of the poles (Hz) that stay where they are as the order grows and are no modes, rising.

    Poles count whose own peak is a twentieth of what was measured there; one within the half-power half-width of a
    mode, or half a percent of it, is that mode.
    """
    modes = np.array([frequency for band in state.bands for frequency in band.fit.frequency])
    return np.sort([frequency for frequency, zeta in _seen(state) if _is_apart(frequency, zeta, modes)])


def _seen(state: Extraction) -> Iterator[tuple[float, float]]:
    """Frequency and damping ratio of each stable pole whose own peak is worth a share of what was measured there."""
    measured = np.max([np.abs(frf.mobility) for frf in state.frfs], axis=0)
    for poles in map(physical_poles, survey(state)):
        for frequency, zeta, largest in zip(poles.frequency, poles.damping_ratio, poles.largest, strict=True):
            there = measured[np.argmin(np.abs(state.frf.frequency - frequency))]
            if np.pi * frequency * largest / zeta > LEAST_SHARE * there:
                yield float(frequency), float(zeta)


def _is_apart(frequency: float, zeta: float, modes: Array) -> bool:
    return bool(np.min(np.abs(modes - frequency), initial=np.inf) > max(zeta, NEAR) * frequency)


def _gaps(state: Extraction) -> Iterator[slice]:
    """Lines outside all bands, in parts."""
    start = 0
    ends = [*((band.lines.start, band.lines.stop) for band in state.bands), (state.frf.frequency.size,) * 2]
    for stop, following in ends:
        if stop - start >= FEWEST_LINES:
            borders = np.linspace(start, stop, -(-(stop - start) // MOST_LINES) + 1).astype(int)
            yield from (slice(*pair) for pair in zip(borders[:-1].tolist(), borders[1:].tolist(), strict=True))
        start = max(start, following)
