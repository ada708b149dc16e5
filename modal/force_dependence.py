"""Natural frequencies that change with the force of the hit: a joint that softens."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from acquisition import Frf, Hit, Remark
from modal.bands.extraction import Extraction, FittedBand
from modal.jackknife import changes
from modal.modes.mode import Mode
from modal.quality.trust import Trust, trust_of

FEWEST = 6
"""Hits that a slope is told from, at least."""
RANGE = 1.3
"""Force of the hardest hit over that of the softest, at least."""
LEAST_CHANGE = 1e-3
"""Relative change of the frequency from the softest hit to the hardest that is worth saying; chosen."""
SURE = 0.9995
"""Probability that chance gives no such slope to one side."""


def with_force_remarks(
    state: Extraction, band: FittedBand, modes: Sequence[Mode], hits: Sequence[Hit], without: Sequence[Frf]
) -> list[Mode]:
    """Modes of a band, the trusted ones whose frequency surely changes with the force of single hits with a remark.

    hits: those of the driving point; without: its FRF without each of them. H1 weighs a hit by its power p: with all of
    them it is the mean by p, so that one hit alone is as far from it as the FRF without it, times -(sum p - p)/p. A
    line is fitted to the frequencies of single hits over their peaks, weighted by p.
    """
    peaks = np.array([np.max(hit.force) - np.median(hit.force) for hit in hits])
    if len(hits) < FEWEST or np.max(peaks) < RANGE * np.min(peaks):
        return [*modes]
    alone = changes(state, band, 0, without, state.frf.receptance[band.lines])[:, : len(modes)]
    return [_with_remark(mode, peaks, _single(alone[:, i], peaks**2)) for i, mode in enumerate(modes)]


def _single(change: NDArray[np.float64], power: NDArray[np.float64]) -> NDArray[np.float64]:
    """Change of the frequency (Hz) of single hits against all, from that without each."""
    return np.asarray(-change * (np.sum(power) - power) / power)


def _with_remark(mode: Mode, peaks: NDArray[np.float64], change: NDArray[np.float64]) -> Mode:
    slope, error = _line(peaks, change)
    sure = float(scipy.special.stdtrit(peaks.size - 2, SURE))
    is_felt = abs(slope) * np.ptp(peaks) > LEAST_CHANGE * mode.frequency
    if trust_of(mode) is not Trust.TRUSTED or not is_felt or abs(slope) < sure * error:
        return mode
    per, words = 100 * 100 / mode.frequency, "softens" if slope < 0 else "stiffens"
    forces = f"from {np.min(peaks):.0f} to {np.max(peaks):.0f} N"
    shift = f"{per * slope:+.2g} ± {per * error:.1g} % for 100 N more, {forces}"
    text = f"{words} with the force of the hit: f_n changes by {shift}"
    cure = "look at joints and clamping; hit equally hard"
    return replace(mode, remarks=(*mode.remarks, Remark("force-dependent", f"{mode.frequency:.0f} Hz", text, cure)))


def _line(x: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[float, float]:
    """Slope and its standard error, weighted by x^2."""
    columns = np.column_stack([x, x**2])
    value, *_ = np.linalg.lstsq(columns, x * y, rcond=None)
    left = x * y - columns @ value
    variance = float(left @ left) / (x.size - 2) * np.linalg.inv(columns.T @ columns)[1, 1]
    return float(value[1]), float(np.sqrt(variance))
