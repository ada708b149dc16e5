"""Detect double hits in the force pulse and in the free decay."""

from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
import scipy

from acquisition.arrays import Floats, find_median
from acquisition.hits.pulse import Pulse

DOUBLE_HIT_SHARE = 0.025
"""Height over the first pulse from which a second pulse makes a double hit; 3 % is found for any shape."""
HEIGHT_NOISE_MARGIN = 3.0
"""Reduction of that height in noise, in multiples of the noise of the pulse height."""
PULSE_WIDTH_RATIOS = (0.7, 1.0, 1.4, 2.0)
"""Widths to search for, over that of the first pulse: a lighter touch lasts longer."""
MIN_PULSE_PROMINENCE = 0.3
"""Smallest prominence over either side, as a share of the height: 0.75 of a pulse, 0 of a recovering force."""
PULSE_FALSE_ALARM_RATE = 1e-3
"""Probability that noise passes for a second pulse in one hit."""
BINS_PER_PULSE = 8
"""Number of averaged samples per pulse width; fewer where it was recorded with fewer."""


@dataclass(frozen=True)
class SecondPulse:
    """Second pulse of a hit."""

    delay: float
    """Samples from the peak of the main pulse, negative before it."""
    share: float
    """Height over that of the main pulse (-)."""


def find_second_pulse(pulse: Pulse) -> SecondPulse | None:
    """Find the highest second pulse more than one pulse width away from the main one; None without one.

    The force is correlated with a raised-cosine bump less its own mean over three times its length. Offset, drift and
    mains hum drop out, and noise is averaged over a pulse. The bump must be higher than either side: behind a
    conditioner with a high pass the force sinks below zero after the main pulse and recovers, which is no touch. A
    pulse counts where it is farther out of the noise of that estimate (median absolute deviation in the same record)
    than noise would reach in one of a thousand hits, and is not certainly below 2.5 % of the main pulse.

    Source of the matched filter: Turin, IRE Trans. Inform. Theory 6 (1960) 311.
    """
    width = pulse.end - pulse.start
    step = max(1, width // BINS_PER_PULSE)
    force = _remove_main_pulse(pulse, width)
    force = force[: force.size // step * step].reshape(-1, step).mean(axis=1)
    span = width / step
    near = (np.array([pulse.start - width, pulse.end + width]) / step).astype(int)
    limit = NormalDist().inv_cdf(1 - PULSE_FALSE_ALARM_RATE / (force.size * len(PULSE_WIDTH_RATIOS)))
    best = SecondPulse(0.0, 0.0)
    for relative in PULSE_WIDTH_RATIOS:
        heights = _fit_bump_heights(force, 1.4 * relative * span)
        outside, rise = np.concatenate((heights[:, : max(near[0], 0)], heights[:, near[1] :]), axis=1)
        if outside.size < BINS_PER_PULSE:
            continue
        standing = np.where(rise > MIN_PULSE_PROMINENCE * outside, outside, 0.0)
        at = int(np.argmax(standing))
        share = float(standing[at]) / pulse.peak
        if share <= max(best.share, DOUBLE_HIT_SHARE / (1 + HEIGHT_NOISE_MARGIN / limit)):
            continue  # whatever the noise is
        noise = 1.4826 * float(np.median(np.abs(outside - np.median(outside))))
        if standing[at] > limit * noise and share > DOUBLE_HIT_SHARE - HEIGHT_NOISE_MARGIN * noise / pulse.peak:
            bin_ = at if at < near[0] else at - max(near[0], 0) + near[1]
            best = SecondPulse((bin_ + 0.5) * step - pulse.peak_index, share)
    return best if best.share else None


def _remove_main_pulse(pulse: Pulse, width: int) -> Floats:
    """Replace the main pulse and half its width on either side by a straight line."""
    low, high = max(pulse.start - width // 2, 0), min(pulse.end + width // 2, pulse.recorded.size)
    force = pulse.force
    before, after = force[max(low - width // 2, 0) : low], force[high : high + max(width // 2, 1)]
    ends = [float(np.mean(side)) if side.size else None for side in (before, after)]
    left, right = (end if end is not None else opposite or 0.0 for end, opposite in (ends, ends[::-1]))
    force[low:high] = np.linspace(left, right, high - low)
    return force


def _fit_bump_heights(force: Floats, foot: float) -> Floats:
    """Fit a raised cosine around every sample, shape (2, n).

    Rows: its least-squares height, and its prominence over the higher side. foot: width of the bump (samples).
    """
    half, wing = int(np.ceil(1.5 * foot)), int(np.ceil(foot / 2)) - 1
    place = np.arange(-wing, wing + 1)
    bump = 0.5 * (1 + np.cos(2 * np.pi * place / foot))
    length, side = 2 * half + 1, half - wing
    mean = bump.sum() / length
    padded = np.pad(force, half, mode="reflect")
    sums = np.concatenate(([0.0], np.cumsum(padded)))
    weighed = np.convolve(padded[side : padded.size - side], bump, "valid")
    parts = ((0, side), (length - side, length), (0, length))
    left, right, whole = (sums[stop:][: force.size] - sums[start:][: force.size] for start, stop in parts)
    height = (weighed - mean * whole) / (np.sum(bump**2) - length * mean**2)
    return np.stack([height, weighed / bump.sum() - np.maximum(left, right) / side])


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
