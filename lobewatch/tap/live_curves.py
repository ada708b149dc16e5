"""Curves of the last hit and of the mean, reduced for display."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition import Frf, Hit, RunningMean, compute_cross_spectra, extract_free_decay
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
    spectrum = None if spectra is None else _to_decibels(spectra[0][1:])
    sizes = [None if frf is None else np.abs(frf.receptance) for frf in (mean.frf, last)]
    end = (
        frequency.size
        if band is None
        else int(np.searchsorted(frequency, SPECTRUM_BAND_FACTOR * band[1], side="right"))
    )
    lines = find_extremes([curve for curve in (*sizes, spectrum) if curve is not None], end)
    return LiveCurves(
        time=hit.time[shown],
        force=hit.force[shown],
        acceleration=hit.acceleration[shown],
        frequency=frequency[lines],
        mean=_pick_lines(sizes[0], lines),
        last=_pick_lines(sizes[1], lines),
        coherence=_pick_lines(_get_coherence(mean.frf), lines),
        force_spectrum=_pick_lines(spectrum, lines),
        usable_band=band,
    )


def _build_decay_curves(hit: Hit) -> LiveCurves:
    """Build the curves of a hit without force: its free decay as receptance of an unknown force."""
    shown = find_extremes([hit.acceleration], hit.acceleration.size)
    (spectrum,) = decay_spectra(extract_free_decay(hit), hit.sample_rate)
    size = np.abs(spectrum.receptance)
    low, high = np.searchsorted(
        spectrum.frequency, [MIN_DECAY_CURVE_FREQUENCY, MAX_DECAY_FREQUENCY_RATIO * hit.sample_rate]
    )
    size *= DECAY_PEAK_RECEPTANCE / np.max(size[low:high])
    lines = low + find_extremes([size[low:]], int(high - low))
    return LiveCurves(
        time=hit.time[shown],
        force=None,
        acceleration=hit.acceleration[shown],
        frequency=spectrum.frequency[lines],
        mean=None,
        last=size[lines],
        coherence=None,
        force_spectrum=None,
        usable_band=None,
    )


def _get_coherence(frf: Frf | None) -> Floats | None:
    return None if frf is None or frf.n_averages < MIN_HITS_FOR_COHERENCE else frf.coherence


def _pick_lines(curve: Floats | None, lines: Integers) -> Floats | None:
    return None if curve is None else curve[lines]


def _to_decibels(power: Floats) -> Floats:
    """Return dB below the largest value, at most 100."""
    return np.asarray(10 * np.log10(np.maximum(power / np.max(power), 1e-10)))


def _select_samples(hit: Hit) -> Integers:
    """Select the samples to show: all around the pulse, the extremes of every bin elsewhere."""
    kept = find_extremes([hit.force, hit.acceleration], hit.force.size)
    pulse = find_pulse(hit)
    if pulse is None:
        return kept
    width = pulse.end - pulse.start
    around = np.arange(max(pulse.start - 2 * width, 0), min(pulse.end + 4 * width, hit.force.size))
    return np.union1d(kept, around[:: around.size // CURVE_BINS + 1])


def find_extremes(curves: Sequence[NDArray[Any]], end: int) -> Integers:
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
