"""Curves of the last hit and of the mean, reduced for display."""

from collections.abc import Sequence

import numpy as np

from acquisition import Hit, RunningMean, compute_cross_spectra, extract_free_decay
from acquisition.estimation.estimate_frf import estimate_frf_from_spectra
from acquisition.hits.pulse import find_pulse
from lobewatch.arrays import Floats, Integers
from lobewatch.measurement.sensor_effects import MAX_DECAY_FREQUENCY_RATIO
from lobewatch.tap.state import LiveCurves
from modal import decay_spectra

CURVE_BINS = 400
"""Number of bins of a curve. The highest and lowest sample of every bin are shown."""
SPECTRUM_BAND_FACTOR = 1.25
"""Upper end of shown spectra over that of the usable band."""
MIN_DECAY_CURVE_FREQUENCY = 50.0
"""Lowest shown frequency of a decay spectrum (Hz). Below it noise over frequency squared dominates."""
DECAY_PEAK_RECEPTANCE = 1e-6
"""Receptance at which the highest line of a decay is shown, as its force is unknown (m/N)."""
MIN_HITS_FOR_COHERENCE = 3
"""Hits needed for a meaningful coherence."""


def build_curves(hit: Hit, mean: RunningMean) -> LiveCurves:
    """Build the curves shown after a hit, good or not."""
    if not hit.has_force:
        return _build_decay_curves(hit)
    shown = _select_samples(hit)
    spectra = None if find_pulse(hit) is None else compute_cross_spectra([hit])
    last = None if spectra is None else estimate_frf_from_spectra(spectra, [hit])
    band = next((frf.usable_band for frf in (mean.frf, last) if frf is not None), None)
    frequency = np.arange(1, hit.force.size // 2 + 1) * hit.sample_rate / hit.force.size
    spectrum = None if spectra is None else 10 * np.log10(np.maximum(spectra[0][1:] / np.max(spectra[0][1:]), 1e-10))
    sizes = [None if frf is None else np.abs(frf.receptance) for frf in (mean.frf, last)]
    highest = frequency[-1] if band is None else SPECTRUM_BAND_FACTOR * band[1]
    end = int(np.searchsorted(frequency, highest, side="right"))
    lines = find_extremes([curve for curve in (*sizes, spectrum) if curve is not None], end)
    frf = mean.frf
    coherence = None if frf is None or frf.n_averages < MIN_HITS_FOR_COHERENCE else frf.coherence
    curves = (None if curve is None else curve[lines] for curve in (*sizes, coherence, spectrum))
    mean_size, last_size, coherence, spectrum = curves
    signals = hit.time[shown], hit.force[shown], hit.acceleration[shown]
    return LiveCurves(*signals, frequency[lines], mean_size, last_size, coherence, spectrum, band)


def _build_decay_curves(hit: Hit) -> LiveCurves:
    """Build the curves of a hit without force: its free decay as receptance of an unknown force."""
    shown = find_extremes([hit.acceleration], hit.acceleration.size)
    (spectrum,) = decay_spectra(extract_free_decay(hit), hit.sample_rate)
    size = np.abs(spectrum.receptance)
    limits = [MIN_DECAY_CURVE_FREQUENCY, MAX_DECAY_FREQUENCY_RATIO * hit.sample_rate]
    low, high = np.searchsorted(spectrum.frequency, limits)
    size *= DECAY_PEAK_RECEPTANCE / np.max(size[low:high])
    lines = low + find_extremes([size[low:]], int(high - low))
    return LiveCurves(hit.time[shown], None, hit.acceleration[shown], spectrum.frequency[lines], last=size[lines])


def _select_samples(hit: Hit) -> Integers:
    """Select the samples to show: all around the pulse, the extremes of every bin elsewhere."""
    kept = find_extremes([hit.force, hit.acceleration], hit.force.size)
    pulse = find_pulse(hit)
    if pulse is None:
        return kept
    width = pulse.end - pulse.start
    around = np.arange(max(pulse.start - 2 * width, 0), min(pulse.end + 4 * width, hit.force.size))
    return np.union1d(kept, around[:: around.size // CURVE_BINS + 1])


def find_extremes(curves: Sequence[Floats], end: int) -> Integers:
    """Return increasing indices below `end` at which a curve is highest or lowest in its bin."""
    width = max(-(-end // CURVE_BINS), 1)
    if width == 1 or not curves:
        return np.arange(0, end, width)
    starts = np.arange(0, end, width)
    indices = [starts]
    for curve in curves:
        bins = np.pad(curve[:end], (0, -end % width), mode="edge").reshape(-1, width)
        indices += [starts + np.argmax(bins, axis=1), starts + np.argmin(bins, axis=1)]
    return np.unique(np.minimum(np.concatenate(indices), end - 1))
