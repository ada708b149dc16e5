"""Prepare the lines of an FRF for a fit: usable band, noise weights, drift."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import scipy

from acquisition import Frf
from modal.arrays import Floats


def usable_lines(frf: Frf, band: tuple[float, float] | None) -> Frf:
    """The lines above 0 Hz that lie in the usable band, where the FRF has one, and in band (Hz).

    Raises ValueError where fewer than two are left.
    """
    above_zero = frf.in_band((frf.frequency[1], frf.frequency[-1])) if frf.frequency[0] == 0 else frf
    return above_zero.in_band(frf.usable_band).in_band(band)


VARIANCE_SMOOTHING_LINES = 25
"""Lines over which the variance is averaged, so that a line that is small by chance does not count for more."""
DISTURBED_LINE_RATIO = 8.0
"""Times the median about it that the variance of an undisturbed line never reaches."""
MAX_USUAL_AVERAGES = 10
"""Hits that few people average more of."""
MIN_VARIANCE_SHARE = 1e-6
"""Share of the mean variance below which no line is believed."""


def line_weights(frf: Frf) -> Floats:
    """Weights of the receptance, 1/rms of its noise up to a factor, shape (n,).

    The noise is that of the coherence where there are three averages or more (random error times |H|, squared and
    averaged over neighbouring lines). Else it is taken as equal on all lines of the quantity that was measured.
    """
    factor = measured_over_receptance(frf)
    error = frf.random_error
    if error is None:
        return factor
    variance = _smooth_variance((error * np.abs(frf.receptance) * factor) ** 2)
    mean = np.mean(variance)
    return factor if mean == 0 else factor / np.sqrt(np.maximum(variance, MIN_VARIANCE_SHARE * mean) / mean)


def incoherent_noise(frf: Frf) -> Floats:
    """rms of the noise of what was measured that its coherence tells, shape (n,); 0 where it tells nothing.

    A coherence below 1 is that of several hits: of ten, where nobody said how many.
    """
    if frf.coherence is None:
        return np.zeros(frf.frequency.size)
    averages = frf.n_averages if frf.n_averages > 1 else MAX_USUAL_AVERAGES
    g2 = np.clip(frf.coherence, 1e-12, 1.0)
    size = np.abs(frf.receptance) * measured_over_receptance(frf)
    return np.asarray(size * np.sqrt((1 - g2) / (2 * averages * g2)))


def _smooth_variance(variance: Floats) -> Floats:
    """Running mean that a disturbed line (hum) does not spread over; such a line keeps its own variance."""
    most = DISTURBED_LINE_RATIO * scipy.ndimage.median_filter(variance, VARIANCE_SMOOTHING_LINES)
    return np.where(
        variance > most, variance, scipy.ndimage.uniform_filter1d(np.minimum(variance, most), VARIANCE_SMOOTHING_LINES)
    )


def measured_over_receptance(frf: Frf) -> Floats:
    """|measured quantity| over |receptance|: 1, omega or omega^2 by line, shape (n,)."""
    power = {"receptance": 0, "mobility": 1, "accelerance": 2}[frf.measured_as]
    return np.asarray((2 * np.pi * frf.frequency) ** power)


MIN_DRIFT_LINES = 12
"""Lines that a drift is told from."""
MAX_DRIFT_FREQUENCY_SHARE = 1 / 16
"""Share of the highest frequency below which it is looked for."""
MAX_DRIFT_SCATTER = 0.1
"""Share of the drift that half of these lines may differ by; more is no drift."""
DRIFT_ROUNDING_SHARE = 1e-9
"""Share of the FRF below which nothing but drift is left."""


def remove_drift(frf: Frf) -> Frf:
    """Without A/f^2, A complex, where the range of low lines that is most like it is no more than that; else as it is.

    A constant error of an accelerance is such a drift of the receptance, of any phase; against the phase of a mode it
    turns the peak into a dip. Behind a high-pass filter it begins above the lowest lines.
    """
    drifts = [_fit_drift(frf, lines) for lines in _low_octaves(frf)]
    scatter, drift = min(drifts, key=lambda candidate: candidate[0], default=(np.inf, 0.0))
    if scatter > MAX_DRIFT_SCATTER:
        return frf
    left = frf.receptance - drift / frf.frequency**2
    return (
        replace(frf, receptance=left) if np.any(np.abs(left) > DRIFT_ROUNDING_SHARE * np.abs(frf.receptance)) else frf
    )


def _fit_drift(frf: Frf, lines: slice) -> tuple[float, complex]:
    """What A is on these lines, after the share of it that half of them differ by."""
    constants = frf.receptance[lines] * frf.frequency[lines] ** 2
    middle = complex(np.median(constants.real), np.median(constants.imag))
    return (float(np.median(np.abs(constants - middle)) / abs(middle)) if middle else np.inf), middle


def _low_octaves(frf: Frf) -> Iterator[slice]:
    """Octaves of the low lines from the lowest up, none of fewer lines than a drift is told from."""
    f, start = frf.frequency, 0
    while start < f.size and f[start] < MAX_DRIFT_FREQUENCY_SHARE * f[-1]:
        end = max(int(np.searchsorted(f, 2 * f[start])), start + MIN_DRIFT_LINES)
        yield slice(start, end)
        start = end
