"""Prepare the lines of an FRF for a fit: usable band, noise weights, drift."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import scipy

from acquisition import Frf
from acquisition.arrays import find_median
from modal.arrays import Flags, Floats


def usable_lines(frf: Frf, band: tuple[float, float] | None) -> Frf:
    """Select the lines above 0 Hz inside the usable band of the FRF and inside `band` (Hz).

    Raises ValueError if fewer than two lines remain.
    """
    above_zero = frf.in_band((frf.frequency[1], frf.frequency[-1])) if frf.frequency[0] == 0 else frf
    return above_zero.in_band(frf.usable_band).in_band(band)


VARIANCE_SMOOTHING_LINES = 25
"""Lines that the variance is averaged over, so that a line that is small by chance does not gain weight."""
DISTURBED_LINE_RATIO = 8.0
"""Variance of a disturbed line over the median around it, at least."""
MAX_USUAL_AVERAGES = 10
"""Number of averages assumed if it is unknown."""
MIN_VARIANCE_SHARE = 1e-6
"""Least variance of a line over the mean variance."""


def line_weights(frf: Frf) -> Floats:
    """Return the weights of the receptance, 1/rms of its noise up to a factor, shape (n,).

    With three averages or more the noise follows from the coherence (random error times |H|, squared and
    averaged over neighbouring lines). Otherwise it is equal on all lines of the measured quantity.
    """
    factor = measured_over_receptance(frf)
    error = frf.random_error
    if error is None:
        return factor
    variance = _smooth_variance((error * np.abs(frf.receptance) * factor) ** 2)
    mean = np.mean(variance)
    return factor if mean == 0 else factor / np.sqrt(np.maximum(variance, MIN_VARIANCE_SHARE * mean) / mean)


def incoherent_noise(frf: Frf) -> Floats:
    """Return the noise rms of the measured quantity from its coherence, shape (n,), or 0 without coherence.

    An unknown number of averages counts as ten.
    """
    if frf.coherence is None:
        return np.zeros(frf.frequency.size)
    averages = frf.n_averages if frf.n_averages > 1 else MAX_USUAL_AVERAGES
    g2 = np.clip(frf.coherence, 1e-12, 1.0)
    size = np.abs(frf.receptance) * measured_over_receptance(frf)
    return np.asarray(size * np.sqrt((1 - g2) / (2 * averages * g2)))


def mean_coherence(frf: Frf, lines: slice | Flags) -> float | None:
    """Return the mean coherence over some lines; None if the coherence is unknown."""
    if frf.coherence is None or not frf.has_random_error:
        return None
    return float(np.mean(frf.coherence[lines]))


def _smooth_variance(variance: Floats) -> Floats:
    """Smooth the variance over lines, leaving out disturbed lines (hum), which keep their own."""
    most = DISTURBED_LINE_RATIO * scipy.ndimage.median_filter(variance, VARIANCE_SMOOTHING_LINES)
    smooth = scipy.ndimage.uniform_filter1d(np.minimum(variance, most), VARIANCE_SMOOTHING_LINES)
    return np.where(variance > most, variance, smooth)


def measured_over_receptance(frf: Frf) -> Floats:
    """Return |measured quantity| over |receptance| by line: 1, omega or omega^2, shape (n,)."""
    power = {"receptance": 0, "mobility": 1, "accelerance": 2}[frf.measured_as]
    return np.asarray((2 * np.pi * frf.frequency) ** power)


MIN_DRIFT_LINES = 12
"""Fewest lines that a drift is fitted to."""
MAX_DRIFT_FREQUENCY_SHARE = 1 / 16
"""Share of the highest frequency below which a drift is searched."""
MAX_DRIFT_SCATTER = 0.1
"""Largest median scatter of a drift, relative to it."""
DRIFT_ROUNDING_SHARE = 1e-9
"""Share of the FRF below which nothing but drift is without_drift."""


def remove_drift(frf: Frf) -> Frf:
    """Subtract the drift A/f^2 (A complex) of an accelerometer without motion, if the low lines show one.

    A constant error of an accelerance is such a drift of the receptance, of any phase; against the phase of a mode it
    turns the peak into a dip. Behind a high-pass filter it begins above the lowest lines.
    """
    drifts = [_fit_drift(frf, lines) for lines in _low_octaves(frf)]
    scatter, drift = min(drifts, key=lambda candidate: candidate[0], default=(np.inf, 0.0))
    if scatter > MAX_DRIFT_SCATTER:
        return frf
    without_drift = frf.receptance - drift / frf.frequency**2
    is_rounding = not np.any(np.abs(without_drift) > DRIFT_ROUNDING_SHARE * np.abs(frf.receptance))
    return frf if is_rounding else replace(frf, receptance=without_drift)


def _fit_drift(frf: Frf, lines: slice) -> tuple[float, complex]:
    """Return the relative scatter of A over some lines, and A."""
    constants = frf.receptance[lines] * frf.frequency[lines] ** 2
    middle = complex(find_median(constants.real), find_median(constants.imag))
    return (find_median(np.abs(constants - middle)) / abs(middle) if middle else np.inf), middle


def _low_octaves(frf: Frf) -> Iterator[slice]:
    """Yield octaves of the low lines from the lowest up, each with enough lines for a drift."""
    f, start = frf.frequency, 0
    while start < f.size and f[start] < MAX_DRIFT_FREQUENCY_SHARE * f[-1]:
        end = max(int(np.searchsorted(f, 2 * f[start])), start + MIN_DRIFT_LINES)
        yield slice(start, end)
        start = end
