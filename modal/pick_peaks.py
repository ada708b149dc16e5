"""Modes by peak picking, as in Gaber & Hashemi."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from acquisition import Frf
from modal.bands.find_resonances import Resonance, find_resonances
from modal.bands.usable_lines import usable_lines
from modal.modes.mode import Mode

REACH = 2.5
"""The extremes are looked for within this many half-widths of the peak; a single mode has them at one."""


def pick_peaks(frf: Frf, band: tuple[float, float] | None = None) -> list[Mode]:
    """Modes between band[0] and band[1] (Hz) from three points of the receptance G each; maybe none.

    f_n is at the extreme of Im G, f_a < f_b at the extremes of Re G on its two sides, each between lines by a
    parabola: zeta = (f_b - f_a)/(2 f_n) (eq. 28) and K = -1/(2 zeta Im G(f_n)) (eq. 29). Exact as zeta goes to 0:
    for one mode alone zeta comes out too large by zeta^2 of itself, and neighbours and noise are not allowed for.
    A peak without both extremes of Re G near it is left out.
    Source: Gaber & Hashemi (2015), eqs. (28)-(29).

    Raises ValueError as `fit_modes`.

    >>> frf = synthesize([Mode(500.0, 0.02, 2e7)], np.arange(300.0, 700.0, 0.1))
    >>> (picked,) = pick_peaks(frf)
    >>> f"{picked.frequency:.1f} Hz, {picked.damping_ratio:.4f}, {picked.stiffness / 1e6:.2f} N/um"
    '499.9 Hz, 0.0200, 19.99 N/um'
    """
    lines = usable_lines(frf, band)
    picked = [_pick(lines, resonance) for resonance in find_resonances(lines)]
    return [mode for mode in picked if mode is not None]


def _pick(frf: Frf, resonance: Resonance) -> Mode | None:
    f, G = frf.frequency, frf.receptance
    reach = REACH * resonance.half_width
    top = int(np.searchsorted(f, resonance.frequency))
    first = min(int(np.searchsorted(f, f[top] - reach)), top - 3)
    end = max(int(np.searchsorted(f, f[top] + reach, side="right")), top + 4)
    near = slice(max(first, 0), end)
    sign = 1.0 if G.imag[top] < 0 else -1.0
    peak = _highest(f, -sign * G.imag, near)
    below = _highest(f, sign * G.real, slice(near.start, top + 1))
    above = _highest(f, -sign * G.real, slice(top, near.stop))
    if peak is None or below is None or above is None:
        return None
    damping = (above[0] - below[0]) / (2 * peak[0])
    return Mode(peak[0], damping, sign / (2 * damping * peak[1]), method="peak picking")


def _highest(f: NDArray[np.float64], values: NDArray[np.float64], near: slice) -> tuple[float, float] | None:
    """Top of a parabola through the largest value and its neighbours, place and height; None where it has none."""
    i = int(np.argmax(values[near])) + near.start
    if i in (near.start, min(near.stop, f.size) - 1):
        return None
    x, y = f[i - 1 : i + 2] - f[i], values[i - 1 : i + 2]
    curvature, slope, height = np.polyfit(x / x[2], y, 2)
    if not curvature < 0:
        return None
    return float(f[i] - x[2] * slope / (2 * curvature)), float(height - slope**2 / (4 * curvature))
