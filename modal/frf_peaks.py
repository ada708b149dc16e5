"""Read peaks of an FRF directly: peak picking, mode indicator, truncated peaks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from acquisition import Frf
from modal.arrays import Complexes, Floats
from modal.bands.find_resonances import MIN_FRF_LINES, MIN_PEAK_TO_NOISE, Resonance, find_resonances, mobility_noise
from modal.bands.frf_lines import usable_lines
from modal.modes.mode import Mode

PEAK_SEARCH_HALF_WIDTHS = 2.5
"""The extremes are looked for within this many half-widths of the peak; a single mode has them at one."""


def pick_peaks(frf: Frf, band: tuple[float, float] | None = None) -> list[Mode]:
    """Modes between band[0] and band[1] (Hz) from three points of the receptance G each; maybe none.

    f_n is at the extreme of Im G, f_a < f_b at the extremes of Re G on its two sides, each between lines by a
    parabola: zeta = (f_b - f_a)/(2 f_n) (eq. 28) and K = -1/(2 zeta Im G(f_n)) (eq. 29). Exact as zeta goes to 0:
    for one mode alone zeta comes out too large by zeta^2 of itself, and neighbours and noise are not allowed for.
    A peak without both extremes of Re G near it is left out.
    Source: Gaber & Hashemi (2015), eqs. (28)-(29).

    Raises ValueError as `fit_modes`.

    >>> frf = synthesize_frf([Mode(500.0, 0.02, 2e7)], np.arange(300.0, 700.0, 0.1))
    >>> (picked,) = pick_peaks(frf)
    >>> f"{picked.frequency:.1f} Hz, {picked.damping_ratio:.4f}, {picked.stiffness / 1e6:.2f} N/um"
    '499.9 Hz, 0.0200, 19.99 N/um'
    """
    lines = usable_lines(frf, band)
    picked = [_pick_mode(lines, resonance) for resonance in find_resonances(lines)]
    return [mode for mode in picked if mode is not None]


def _pick_mode(frf: Frf, resonance: Resonance) -> Mode | None:
    f, G = frf.frequency, frf.receptance
    reach = PEAK_SEARCH_HALF_WIDTHS * resonance.half_width
    top = int(np.searchsorted(f, resonance.frequency))
    first = min(int(np.searchsorted(f, f[top] - reach)), top - 3)
    end = max(int(np.searchsorted(f, f[top] + reach, side="right")), top + 4)
    near = slice(max(first, 0), end)
    sign = 1.0 if G.imag[top] < 0 else -1.0
    peak = _parabola_peak(f, -sign * G.imag, near)
    below = _parabola_peak(f, sign * G.real, slice(near.start, top + 1))
    above = _parabola_peak(f, -sign * G.real, slice(top, near.stop))
    if peak is None or below is None or above is None:
        return None
    damping = (above[0] - below[0]) / (2 * peak[0])
    return Mode(peak[0], damping, sign / (2 * damping * peak[1]), method="peak picking")


def _parabola_peak(f: Floats, values: Floats, near: slice) -> tuple[float, float] | None:
    """Top of a parabola through the largest value and its neighbours, place and height; None where it has none."""
    i = int(np.argmax(values[near])) + near.start
    if i in (near.start, min(near.stop, f.size) - 1):
        return None
    x, y = f[i - 1 : i + 2] - f[i], values[i - 1 : i + 2]
    curvature, slope, height = np.polyfit(x / x[2], y, 2)
    if not curvature < 0:
        return None
    return float(f[i] - x[2] * slope / (2 * curvature)), float(height - slope**2 / (4 * curvature))


def mode_indicator(frfs: Sequence[Frf]) -> Floats:
    """Mode indicator 1 - sum |Re G| |G| / sum |G|^2 over the receptances G, on every line, shape (n,).

    It comes near 1 where all points move a quarter period behind the force, at the natural frequency of a real mode
    that stands alone, and near 0 elsewhere. Zero where nothing moves. Raises ValueError for no FRF and for FRFs with
    different lines. Source: Hunt, Vold, Peterson & Williams (1984), SAE 841581.

    >>> frf = synthesize_frf([Mode(500.0, 0.02, 2e7)], [250.0, 500.0])
    >>> mode_indicator([frf]).round(3).tolist()  # 1 at the natural frequency
    [0.0, 1.0]
    """
    if not frfs:
        raise ValueError("there is no FRF; give one or more")
    if any(not np.array_equal(frf.frequency, frfs[0].frequency) for frf in frfs):
        raise ValueError("the FRFs differ in their frequency lines; measure or export all with the same settings")
    receptance = np.array([frf.receptance for frf in frfs])
    size = np.abs(receptance)
    energy = np.sum(size**2, axis=0)
    still = energy == 0
    real = np.sum(np.abs(receptance.real) * size, axis=0)
    return np.where(still, 0.0, 1 - real / np.where(still, 1.0, energy))


MIN_INNER_PEAK_RATIO = 10 ** (1 / 20)
"""A line inside that is this many times as high as the edge is a peak of its own."""
MIN_REAL_PART_DROP = 0.7
"""Where |mobility| of a mode has fallen to 1/sqrt(2) its real part, as |mobility|^2, is halved; before an antiresonance
it stays."""


def find_truncated_peaks(frf: Frf, modes: Sequence[Mode], band: tuple[float, float] | None = None) -> list[float]:
    """First and last line (Hz) between band[0] and band[1] where a peak may be cut that none of the modes accounts for.

    There |mobility| falls from the edge inwards below 1/sqrt(2) of its value and is more real than imaginary, as it
    is between the half-power points of a mode; on the line of a mass or a spring it is imaginary. Its real part
    falls with it, which it does not between a peak and an antiresonance. Raises ValueError as `usable_lines`.

    >>> frf = synthesize_frf([Mode(500.0, 0.02, 2e7)], np.arange(505.0, 1001.0))  # begins on the flank of a peak
    >>> find_truncated_peaks(frf, [])
    [505.0]
    """
    lines = usable_lines(frf, band)
    f, mobility = lines.frequency, lines.mobility
    noise = mobility_noise(lines)
    edges = [
        float(f[end])
        for end, step in ((0, 1), (-1, -1))
        if _falls_like_peak(mobility[::step], MIN_PEAK_TO_NOISE * noise[end])
    ]
    return [
        edge
        for edge in edges
        if all(abs(mode.frequency - edge) > mode.damping_ratio * mode.frequency for mode in modes)
    ]


def _falls_like_peak(mobility: Complexes, least: float) -> bool:
    """Whether it falls from its first line like a peak, and is higher there than the least."""
    size = np.abs(mobility)
    low = np.flatnonzero(size < size[0] / np.sqrt(2))
    if not low.size or low[0] < 2 or size[0] < least or np.max(size[: low[0]]) > MIN_INNER_PEAK_RATIO * size[0]:
        return False
    is_real = abs(mobility[0].real) > abs(mobility[0].imag)
    return bool(is_real and mobility[low[0]].real / mobility[0].real < MIN_REAL_PART_DROP)


def find_peaks_above_band(frf: Frf) -> list[float]:
    """Frequencies of the resonances above the usable band (Hz); none where it is not known, or no line lies there.

    >>> frf = synthesize_frf([Mode(500.0, 0.02, 2e7), Mode(1800.0, 0.02, 2e7)], np.arange(1.0, 2001.0))
    >>> from dataclasses import replace
    >>> [round(f) for f in find_peaks_above_band(replace(frf, find_usable_band=(1.0, 1500.0)))]  # Hz: the hammer did not reach it
    [1800]
    """
    if frf.usable_band is None:
        return []
    end = frf.usable_band[1]
    if (frf.frequency > end).sum() < MIN_FRF_LINES:
        return []
    above = frf.in_band((end, float(frf.frequency[-1])))
    try:
        return [peak.frequency for peak in find_resonances(above)]
    except ValueError:
        return []
