"""Find a delay of the response that turns the modes of an FRF."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from acquisition import Frf
from modal.arrays import Complexes, Flags, Floats, Indices
from modal.modes.mode import Mode

MAX_DELAY = 0.01
"""Longest delay that is searched (s); chosen. Filters of converters delay by up to some milliseconds."""
STEPS_PER_PERIOD = 16
"""Steps of the search per period of the highest mode; chosen."""
PEAK_HALF_WIDTHS = 3.0
"""Half-power half-widths around each mode whose lines count; chosen."""
MIN_PEAK_LINES, MAX_PEAK_LINES = 8, 40
"""Fewest and most lines of one mode; chosen."""
MIN_LEFT_SHARE, MAX_LEFT_RATIO = 0.05, 0.05
"""Least sum of squares without the delay, as a share of all, and largest with the delay over that; chosen.

Without a delay, measured FRFs of beams, blades, tools and a wing have 0.001 to 0.4, and no delay takes off so much.
"""
MAX_COST_RATIO = 2.0
"""Sum of squares of a delay over the least of all from which it is less likely; chosen."""
MIN_QUARTER_TURN_RATIO = 5.0
"""Sum of squares after a quarter turn of all modes, over that of a delay, from which it is a delay; chosen."""
MIN_TURN_DEG = 45.0
"""Least turn of the highest mode by a delay (degrees); chosen. A smaller one leaves the signs of K."""


class _Peaks(NamedTuple):
    """Lines near the peaks, each peak with the same weight."""

    frequency: Floats
    """Frequencies (Hz), shape (n,)."""
    values: Complexes
    """Weighted receptances, shape (n,)."""
    columns: Complexes
    """Weighted modes with positive K, mass and spring, shape (n, m + 2)."""


def find_delay(frf: Frf, modes: Sequence[Mode]) -> float | None:
    """Find the delay of the response that makes all modes real.

    A response late by T turns the phase by -2 pi f T: from mode to mode, and over each peak, which tells the number of
    full turns. A quarter turn of all modes is another quantity, not a delay. For each delay, the modes with real
    constants, a mass and a spring are fitted to the lines near the peaks. Of delays that fit about equally, one with
    positive K at all modes is taken, then the shortest.

    Parameters
    ----------
    frf : Frf
        FRF without a line at 0 Hz.
    modes : sequence of Mode
        Its modes, as they were fitted under the delay.

    Returns
    -------
    float or None
        Delay (s), > 0 if the response is late; None for fewer than two modes, and if no delay explains the phases.

    Examples
    --------
    >>> line = np.arange(100.0, 2000.0)
    >>> frf = synthesize_frf([Mode(500.0, 0.02, 2e7), Mode(900.0, 0.03, 5e7)], line)
    >>> late = Frf(line, frf.receptance * np.exp(-2j * np.pi * line * 1e-3))
    >>> fitted = [Mode(500.0, 0.02, -2e7), Mode(900.0, 0.03, 5e7, phase_deg=36.0)]
    >>> round(1e3 * find_delay(late, fitted), 2)  # ms
    1.0
    """
    if len(modes) < 2 or not all(mode.has_stiffness for mode in modes):
        return None
    peaks, highest = _weigh_peaks(frf, modes), max(mode.frequency for mode in modes)
    step = 1 / (STEPS_PER_PERIOD * highest)
    delays = step * np.arange(-round(MAX_DELAY / step), round(MAX_DELAY / step) + 1, dtype=np.float64)
    left, is_positive = _fit_real_modes(peaks, delays)
    if left[delays.size // 2] < MIN_LEFT_SHARE:
        return None
    likely = np.flatnonzero((left <= MAX_COST_RATIO * np.min(left)) & (left <= _lower_neighbour(left)))
    best = delays[min(likely, key=lambda i: (not is_positive[i], abs(delays[i])))]
    fine = np.asarray(best + step * np.linspace(-1, 1, 2 * STEPS_PER_PERIOD + 1), dtype=np.float64)
    costs, _ = _fit_real_modes(peaks, fine)
    delay, cost = float(fine[np.argmin(costs)]), float(np.min(costs))
    (turned,), _ = _fit_real_modes(peaks._replace(values=1j * peaks.values), np.zeros(1))
    explains = cost < MAX_LEFT_RATIO * left[delays.size // 2] and MIN_QUARTER_TURN_RATIO * cost < turned
    return delay if explains and 360 * abs(delay) * highest > MIN_TURN_DEG else None


def _lower_neighbour(values: Floats) -> Floats:
    padded = np.pad(values, 1, mode="edge")
    return np.minimum(padded[:-2], padded[2:])


def _weigh_peaks(frf: Frf, modes: Sequence[Mode]) -> _Peaks:
    lines, weights = list[Indices](), list[Floats]()
    for mode in modes:
        distance = np.abs(frf.frequency - mode.frequency)
        least = np.sort(distance)[min(MIN_PEAK_LINES, distance.size) - 1]
        near = np.flatnonzero(distance <= max(PEAK_HALF_WIDTHS * mode.damping_ratio * mode.frequency, least))
        near = near[:: -(-near.size // MAX_PEAK_LINES)]
        lines.append(near)
        weights.append(np.full(near.size, 1 / (mode.peak * np.sqrt(near.size))))
    place, weight = np.concatenate(lines), np.concatenate(weights)
    f = frf.frequency[place]
    plain = [replace(mode, stiffness=1.0, phase_deg=0.0).receptance(f) for mode in modes]
    columns = np.array([*plain, 1 / f**2, np.ones(f.size)]).T * weight[:, np.newaxis]
    return _Peaks(f, frf.receptance[place] * weight, columns / np.linalg.norm(columns, axis=0))


def _fit_real_modes(peaks: _Peaks, delays: Floats) -> tuple[Floats, Flags]:
    """Return for each delay (s) the share of the squares that real modes leave, and whether all K are positive."""
    q, triangle = np.linalg.qr(np.concatenate([peaks.columns.real, peaks.columns.imag]))
    real, imaginary = np.vsplit(q, 2)
    on_time = np.exp(2j * np.pi * delays[:, np.newaxis] * peaks.frequency) * peaks.values
    part = on_time.real @ real + on_time.imag @ imaginary
    constant = np.linalg.solve(triangle, part.T)[:-2]
    left = 1 - np.sum(part**2, axis=1) / np.sum(np.abs(peaks.values) ** 2)
    return np.maximum(left, np.finfo(float).eps), np.all(constant > 0, axis=0)
