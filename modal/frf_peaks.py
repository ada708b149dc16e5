"""Read peaks of an FRF directly: peak picking, mode indicator, truncated peaks."""

from collections.abc import Sequence

import numpy as np

from acquisition import Frf
from modal.arrays import Complexes, Floats
from modal.bands.find_resonances import MIN_FRF_LINES, MIN_PEAK_TO_NOISE, Resonance, find_resonances, mobility_noise
from modal.bands.frf_lines import usable_lines
from modal.modes.mode import Mode

PEAK_SEARCH_HALF_WIDTHS = 2.5
"""Half-widths around a peak in which its extremes are searched; a single mode has them at one."""


def pick_peaks(frf: Frf, band: tuple[float, float] | None = None) -> list[Mode]:
    """Estimate modes by peak picking, from three points of the receptance G each.

    f_n is at the extreme of Im G, f_a < f_b at the extremes of Re G on its two sides, each between lines by a
    parabola: zeta = (f_b - f_a)/(2 f_n) (eq. 28) and K = -1/(2 zeta Im G(f_n)) (eq. 29). Exact as zeta goes to 0:
    for a single mode zeta is too large by zeta^2 of itself. Neighbours and noise are not allowed for.
    A peak without both extremes of Re G near it is left out.

    Parameters
    ----------
    frf : Frf
        Measured FRF.
    band : tuple of float, optional
        Lowest and highest frequency (Hz).

    Returns
    -------
    list of Mode
        Modes by rising frequency; may be empty.

    Raises
    ------
    ValueError
        As `fit_modes`.

    References
    ----------
    Gaber & Hashemi (2015), eqs. (28)-(29).

    Examples
    --------
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
    """Return place and height of the parabola through the largest value and its neighbours; None at the ends."""
    i = int(np.argmax(values[near])) + near.start
    if i in (near.start, min(near.stop, f.size) - 1):
        return None
    x, y = f[i - 1 : i + 2] - f[i], values[i - 1 : i + 2]
    curvature, slope, height = np.polyfit(x / x[2], y, 2)
    if not curvature < 0:
        return None
    return float(f[i] - x[2] * slope / (2 * curvature)), float(height - slope**2 / (4 * curvature))


def mode_indicator(frfs: Sequence[Frf]) -> Floats:
    """Return the mode indicator 1 - sum |Re G| |G| / sum |G|^2 over the receptances G of several points.

    It comes near 1 if all points move a quarter period behind the force, at the natural frequency of a single real
    mode,
    and near 0 elsewhere. It is zero where nothing moves.

    Parameters
    ----------
    frfs : sequence of Frf
        FRFs with one frequency axis.

    Returns
    -------
    ndarray, shape (n,)
        Indicator on every line (-).

    Raises
    ------
    ValueError
        For no FRF and for FRFs with different lines.

    References
    ----------
    Hunt, Vold, Peterson & Williams (1984), SAE 841581.

    Examples
    --------
    >>> frf = synthesize_frf([Mode(500.0, 0.02, 2e7)], [250.0, 500.0])
    >>> mode_indicator([frf]).round(3).tolist()  # 1 at the natural frequency
    [0.0, 1.0]
    """
    if not frfs:
        raise ValueError("no FRF given. Give one or more FRFs.")
    if any(not np.array_equal(frf.frequency, frfs[0].frequency) for frf in frfs):
        raise ValueError("the FRFs have different frequency lines. Export all FRFs with the same settings.")
    receptance = np.array([frf.receptance for frf in frfs])
    size = np.abs(receptance)
    energy = np.sum(size**2, axis=0)
    still = energy == 0
    real = np.sum(np.abs(receptance.real) * size, axis=0)
    return np.where(still, 0.0, 1 - real / np.where(still, 1.0, energy))


MIN_INNER_PEAK_RATIO = 10 ** (1 / 20)
"""Height of a line inside over that of the edge line from which it is a peak of its own."""
MIN_REAL_PART_DROP = 0.7
"""Largest real part at the half-power point over that at the edge.

|mobility| of a mode drops to 1/sqrt(2) there and its real part, as |mobility|^2, to 1/2; before an antiresonance
the real part stays.
"""


def find_truncated_peaks(frf: Frf, modes: Sequence[Mode], band: tuple[float, float] | None = None) -> list[float]:
    """Return the first or last line if the band cuts a peak there that no mode accounts for.

    There |mobility| falls from the edge inwards below 1/sqrt(2) of its value and is more real than imaginary, as
    between the half-power points of a mode; on the line of a mass or a spring it is imaginary. Its real part
    falls with it, which it does not between a peak and an antiresonance.

    Parameters
    ----------
    frf : Frf
        Measured FRF.
    modes : sequence of Mode
        Fitted modes.
    band : tuple of float, optional
        Lowest and highest frequency (Hz).

    Returns
    -------
    list of float
        Frequencies of the edge lines (Hz).

    Raises
    ------
    ValueError
        If fewer than two lines lie in the band.

    Examples
    --------
    >>> frf = synthesize_frf([Mode(500.0, 0.02, 2e7)], np.arange(505.0, 1001.0))  # begins on the flank of a peak
    >>> find_truncated_peaks(frf, [])
    [505.0]
    """
    lines = usable_lines(frf, band)
    f, mobility = lines.frequency, lines.mobility
    least = MIN_PEAK_TO_NOISE * mobility_noise(lines)
    edges = [float(f[end]) for end, step in ((0, 1), (-1, -1)) if _falls_like_peak(mobility[::step], least[end])]
    return [e for e in edges if all(abs(m.frequency - e) > m.damping_ratio * m.frequency for m in modes)]


def _falls_like_peak(mobility: Complexes, least: float) -> bool:
    """Return whether the mobility falls from its first line like a peak and is higher there than the least."""
    size = np.abs(mobility)
    low = np.flatnonzero(size < size[0] / np.sqrt(2))
    if not low.size or low[0] < 2 or size[0] < least or np.max(size[: low[0]]) > MIN_INNER_PEAK_RATIO * size[0]:
        return False
    is_real = abs(mobility[0].real) > abs(mobility[0].imag)
    return bool(is_real and mobility[low[0]].real / mobility[0].real < MIN_REAL_PART_DROP)


def find_peaks_above_band(frf: Frf) -> list[float]:
    """Return the frequencies of resonances above the usable band, where the hammer hardly reached.

    Parameters
    ----------
    frf : Frf
        FRF with a usable band.

    Returns
    -------
    list of float
        Frequencies (Hz); empty if the band is unknown or no line is above it.

    Examples
    --------
    >>> frf = synthesize_frf([Mode(500.0, 0.02, 2e7), Mode(1800.0, 0.02, 2e7)], np.arange(1.0, 2001.0))
    >>> from dataclasses import replace
    >>> [round(f) for f in find_peaks_above_band(replace(frf, usable_band=(1.0, 1500.0)))]  # Hz
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
