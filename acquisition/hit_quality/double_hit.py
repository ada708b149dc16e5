"""Detect touches that spoil the force spectrum, and double hits in the free decay."""

import numpy as np
import scipy

from acquisition.arrays import Complexes, Floats, find_median
from acquisition.hits.force_window import WindowedForce
from acquisition.hits.touches import Touch

NAMED_TOUCH_SHARE = 0.025
"""Height over the main pulse from which a further touch is named; smaller ones are kept as well (chosen)."""
HOLE_POWER = 0.01
"""Power over the largest below which a line is not used, as for the usable band."""
MIN_LOBE_POWER = 0.1
"""Power over the largest behind a hole; the lobes of no single pulse are as high (0.047 for a rectangle)."""
HOLE_RESOLUTION = 32
"""Number of lines from hole to hole, so that one of them is 26 dB down."""
FAR_LENGTHS = 16
"""Delay over the length of a touch from which the spectra of each are smooth over the holes of both (chosen)."""
FAR_HOLE_LINES = 8 * HOLE_RESOLUTION
"""Number of lines that are searched together for a hole of far touches (chosen)."""


def find_highest_touch(part: WindowedForce) -> Touch | None:
    """Find the highest further touch; None without one of 2.5 % of the main pulse."""
    highest = max(part.touches, key=lambda touch: touch.height, default=None)
    return highest if highest and highest.height >= NAMED_TOUCH_SHARE * part.pulse.peak else None


def find_force_hole(part: WindowedForce, sample_rate: float, end: float) -> float | None:
    """Find the first hole in the force spectrum below a frequency (Hz); None without one.

    Two equal touches with the time T between them cancel at 1/(2 T). A hole is 20 dB below the largest power, between
    lines less than 10 dB below it, which no single pulse has.
    """
    gaps = np.flatnonzero(np.diff(part.samples) > 1) + 1
    parts, starts = np.split(part.force, gaps), part.samples[[0, *gaps]]
    size = scipy.fft.next_fast_len(HOLE_RESOLUTION * max(map(len, parts)), real=True)
    spectra = np.array([np.fft.rfft(force, size) for force in parts])
    if len(parts) > 1 and not _may_cancel(np.abs(spectra)):
        return None
    delay = int(starts[-1] - starts[0])
    is_far = len(parts) == 2 and delay > FAR_LENGTHS * max(map(len, parts))
    hole = _find_far_hole(spectra, size, delay) if is_far else _find_near_hole(part)
    return None if hole is None or hole * sample_rate >= end else hole * sample_rate


def _find_near_hole(part: WindowedForce) -> float | None:
    """Return the first hole over the sample rate, from the spectrum of all touches."""
    delays = part.samples - part.samples[0]
    size = scipy.fft.next_fast_len(HOLE_RESOLUTION * (int(delays[-1]) + 1), real=True)
    force = np.zeros(size)
    force[delays] = part.force
    spectrum = np.fft.rfft(force)
    power = spectrum.real**2 + spectrum.imag**2
    largest = float(np.max(power))
    high = np.flatnonzero(power > MIN_LOBE_POWER * largest)
    line = _first_minimum(power[high[0] : high[-1]], HOLE_POWER * largest)
    return None if line is None else float(high[0] + line) / size


def _find_far_hole(spectra: Complexes, size: int, delay: int) -> float | None:
    """Return the first hole over the sample rate, of two touches with this delay (samples) and the spectra of each.

    The spectra of each are smooth over many holes. Both touches add up or cancel within each, so that their sizes tell
    the largest power and where holes begin. Only the lines from there on are computed.
    """
    sizes = np.abs(spectra)
    most = np.sum(sizes, axis=0)
    limit = HOLE_POWER * np.max(most) ** 2
    high = np.flatnonzero(most**2 > MIN_LOBE_POWER * np.max(most) ** 2)
    deep = high[0] + np.flatnonzero(np.diff(sizes, axis=0)[0, high[0] : high[-1]] ** 2 < limit)
    spacing = 1 / (HOLE_RESOLUTION * delay)
    start, stop = (max(place, 0) / size / spacing for place in (deep[0] - 1 if deep.size else high[-1], high[-1]))
    while start < stop:
        places = (start + np.arange(FAR_HOLE_LINES)) * spacing
        first, second = (np.interp(places * size, np.arange(most.size), spectrum) for spectrum in spectra)
        line = _first_minimum(np.abs(first + second * np.exp(-2j * np.pi * delay * places)) ** 2, limit)
        if line is not None:
            return float(places[line])
        start += FAR_HOLE_LINES
    return None


def _first_minimum(power: Floats, limit: float) -> int | None:
    """Return the lowest line of the first lines in a row that are below a limit; None without any."""
    deep = np.flatnonzero(power < limit)
    if not deep.size:
        return None
    first = np.split(deep, np.flatnonzero(np.diff(deep) > 1) + 1)[0]
    return int(first[np.argmin(power[first])])


def _may_cancel(sizes: Floats) -> bool:
    """Tell whether touches apart could make a hole whatever the time between them, by the spectra of each alone.

    The spectrum of touches far apart has so many lines that it is computed only then.
    """
    most = np.sum(sizes, axis=0)
    least = np.maximum(2 * np.max(sizes, axis=0) - most, 0.0)
    reach = np.flatnonzero(most**2 > MIN_LOBE_POWER * np.max(least) ** 2)[-1]
    return bool(np.any(least[: reach + 1] ** 2 < HOLE_POWER * np.max(most) ** 2))


PREDICTION_ORDER = 32
"""Number of samples that the next one is predicted from: two per mode, and more for noise."""
MIN_DECAY_SAMPLES = 8 * PREDICTION_ORDER
"""Smallest number of samples of a decay."""
ERROR_AVERAGING_TIME = 3e-4
"""Time over which prediction errors are averaged (s): half of a short pulse."""
SECOND_INPUT_RISE_TIME = 1e-3
"""Rise time of a double hit (s): errors are compared with those before it."""
MIN_ERROR_RISE = 2.0
"""Smallest ratio to the largest error before it: nonlinear structures err most while they move most."""
DECAY_FALSE_ALARM_RATE = 1e-4
"""Largest probability that noise is reported as a double hit in one decay."""
NOISE_LIMIT_MARGIN = 1.25
"""Factor on the noise limit, as errors are not quite independent."""
REWEIGHTING_ROUNDS = 4
"""Number of rounds in which outlying errors lose weight."""


def find_second_input(decay: Floats, sample_rate: float, noise: float) -> float | None:
    """Find the time (s) in a free decay (m/s^2) at which it was hit again; None without a sign of it.

    A double hit breaks the linear prediction of a free decay. noise: rms without vibration (m/s^2); a decay below three
    times that does not count. A double hit within 1 ms cannot be distinguished from a nonlinear decay.

    Source of the prediction: Makhoul (1975), Proc. IEEE 63, 561.
    """
    visible = _cut_at_noise(decay, max(round(1e-3 * sample_rate), 4), noise)
    if visible.size < MIN_DECAY_SAMPLES:
        return None
    error = _compute_prediction_error(visible)
    scale = 1.4826 * find_median(np.abs(error))
    span, rise = max(round(ERROR_AVERAGING_TIME * sample_rate), 1), max(round(SECOND_INPUT_RISE_TIME * sample_rate), 1)
    level = np.sqrt(np.convolve(error**2, np.full(span, 1 / span), "valid"))
    if scale == 0 or level.size <= rise:
        return None
    chi_square = scipy.special.chdtri(span, DECAY_FALSE_ALARM_RATE / level.size)
    by_chance = NOISE_LIMIT_MARGIN * scale * np.sqrt(chi_square / span)
    before = np.maximum.accumulate(level)[:-rise]
    above = np.flatnonzero(level[rise:] > np.maximum(by_chance, MIN_ERROR_RISE * before))
    return float(above[0] + rise + PREDICTION_ORDER) / sample_rate if above.size else None


def _cut_at_noise(decay: Floats, width: int, noise: float) -> Floats:
    """Return the decay up to where noise hides it."""
    pieces = decay[: decay.size // width * width].reshape(-1, width)
    loud = np.flatnonzero(np.sqrt(np.mean(pieces**2, axis=1)) > 3 * noise)
    return decay[: (int(loud[-1]) + 1) * width] if loud.size else decay[:0]


def _compute_prediction_error(signal: Floats) -> Floats:
    """Return the errors of a linear prediction that outliers do not bend."""
    past = np.lib.stride_tricks.sliding_window_view(signal[:-1], PREDICTION_ORDER)
    now, weight = signal[PREDICTION_ORDER:], np.ones(signal.size - PREDICTION_ORDER)
    error = now
    for _ in range(REWEIGHTING_ROUNDS):
        solution = np.linalg.lstsq(past * weight[:, np.newaxis], now * weight, rcond=None)[0]
        error = now - past @ solution
        scale = 1.4826 * find_median(np.abs(error))
        weight = 1 / np.maximum(1.0, np.abs(error) / max(2 * scale, 1e-300))
    return error
