"""Detect double hits in the force pulse and in the free decay."""

from __future__ import annotations

from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
import scipy

from acquisition.arrays import Floats
from acquisition.hits.pulse import Pulse

DOUBLE_HIT_SHARE = 0.025
"""A second pulse above this share of the first makes a double hit: one of 3 % is found whatever its shape ..."""
HEIGHT_NOISE_MARGIN = 3.0
"""... and in noise: it is let pass only where it is smaller by this many times the noise of its height."""
PULSE_WIDTH_RATIOS = (0.7, 1.0, 1.4, 2.0)
"""Widths searched for, against that of the first pulse: a lighter touch lasts longer."""
MIN_PULSE_PROMINENCE = 0.3
"""Its middle stands this share of its height above either side: 0.75 of a pulse, 0 where the force only recovers."""
PULSE_FALSE_ALARM_RATE = 1e-3
"""Chance that noise alone passes for a second touch in one hit."""
BINS_PER_PULSE = 8
"""Samples a pulse width after averaging neighbours; fewer where it was recorded with fewer."""


@dataclass(frozen=True)
class SecondPulse:
    """A second pulse."""

    delay: float
    """Samples from the peak of the main pulse, negative where it came before."""
    share: float
    """Height over that of the main pulse (-)."""


def find_second_pulse(pulse: Pulse) -> SecondPulse | None:
    """The highest second pulse farther than one pulse width from the main one; None where there is none.

    The force is correlated with a raised-cosine bump less its own mean over three times its length: offset, drift and
    mains hum drop out, and noise is averaged over a pulse. It must stand above either side: behind a conditioner with
    a high pass the force sinks below zero after the main pulse and recovers, which is no touch. A pulse counts where
    it stands out of the noise of that estimate (found by its median absolute deviation in the same record) farther
    than noise alone would do in one of a thousand hits, however many samples it has, and is not for certain below
    2.5 % of the main pulse.
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
    """The force with a straight line where the main pulse stands, half its width on either side included."""
    low, high = max(pulse.start - width // 2, 0), min(pulse.end + width // 2, pulse.recorded.size)
    force = pulse.force
    before, after = force[max(low - width // 2, 0) : low], force[high : high + max(width // 2, 1)]
    ends = [float(np.mean(side)) if side.size else None for side in (before, after)]
    left, right = (end if end is not None else opposite or 0.0 for end, opposite in (ends, ends[::-1]))
    force[low:high] = np.linspace(left, right, high - low)
    return force


def _fit_bump_heights(force: Floats, foot: float) -> Floats:
    """Least-squares height of a raised cosine of this foot width (samples) around every sample, and how far its middle
    stands above the higher of both sides, shape (2, n)."""
    half, wing = int(np.ceil(1.5 * foot)), int(np.ceil(foot / 2)) - 1
    place = np.arange(-wing, wing + 1)
    bump = 0.5 * (1 + np.cos(2 * np.pi * place / foot))
    length, side = 2 * half + 1, half - wing
    mean = bump.sum() / length
    padded = np.pad(force, half, mode="reflect")
    sums = np.concatenate(([0.0], np.cumsum(padded)))
    weighed = np.convolve(padded[side : padded.size - side], bump, "valid")
    left, right, whole = (
        sums[stop:][: force.size] - sums[start:][: force.size]
        for start, stop in ((0, side), (length - side, length), (0, length))
    )
    height = (weighed - mean * whole) / (np.sum(bump**2) - length * mean**2)
    return np.stack([height, weighed / bump.sum() - np.maximum(left, right) / side])


PREDICTION_ORDER = 32
"""Samples that the next one is predicted from: two for each mode, and more of them for noise."""
MIN_DECAY_SAMPLES = 8 * PREDICTION_ORDER
"""Samples of a decay below which nothing is told."""
ERROR_AVERAGING_TIME = 3e-4
"""Time over which errors of the prediction are taken together (s): half of a short pulse."""
SECOND_INPUT_RISE_TIME = 1e-3
"""Time in which a second touch has risen (s): errors are compared with those before it."""
MIN_ERROR_RISE = 2.0
"""Times the largest error before it: what is not linear in a structure errs most while it moves most."""
DECAY_FALSE_ALARM_RATE = 1e-4
"""Chance that noise alone passes for a second touch in one decay ..."""
NOISE_LIMIT_MARGIN = 1.25
"""... times this, for its errors are not quite independent."""
REWEIGHTING_ROUNDS = 4
"""Rounds in which errors that stand out lose weight."""

Samples = Floats


def find_second_input(decay: Samples, sample_rate: float, noise: float) -> float | None:
    """Time (s) from the first sample of a free decay (m/s^2) at which it was hit again; None where nothing shows it.

    noise: rms at rest (m/s^2); what has fallen below three times that does not count. What comes within 1 ms is not
    told from a decay that is not linear. Source of the prediction: Makhoul (1975), Proc. IEEE 63, 561.
    """
    visible = _cut_at_noise(decay, max(round(1e-3 * sample_rate), 4), noise)
    if visible.size < MIN_DECAY_SAMPLES:
        return None
    error = _compute_prediction_error(visible)
    scale = 1.4826 * float(np.median(np.abs(error)))
    span, rise = max(round(ERROR_AVERAGING_TIME * sample_rate), 1), max(round(SECOND_INPUT_RISE_TIME * sample_rate), 1)
    level = np.sqrt(np.convolve(error**2, np.full(span, 1 / span), "valid"))
    if scale == 0 or level.size <= rise:
        return None
    by_chance = (
        NOISE_LIMIT_MARGIN * scale * np.sqrt(scipy.special.chdtri(span, DECAY_FALSE_ALARM_RATE / level.size) / span)
    )
    before = np.maximum.accumulate(level)[:-rise]
    above = np.flatnonzero(level[rise:] > np.maximum(by_chance, MIN_ERROR_RISE * before))
    return float(above[0] + rise + PREDICTION_ORDER) / sample_rate if above.size else None


def _cut_at_noise(decay: Samples, width: int, noise: float) -> Samples:
    """The decay up to where it is lost in noise."""
    pieces = decay[: decay.size // width * width].reshape(-1, width)
    loud = np.flatnonzero(np.sqrt(np.mean(pieces**2, axis=1)) > 3 * noise)
    return decay[: (int(loud[-1]) + 1) * width] if loud.size else decay[:0]


def _compute_prediction_error(signal: Samples) -> Samples:
    """What the samples before it do not tell of each sample, by a prediction that outliers do not bend."""
    past = np.lib.stride_tricks.sliding_window_view(signal[:-1], PREDICTION_ORDER)
    now, weight = signal[PREDICTION_ORDER:], np.ones(signal.size - PREDICTION_ORDER)
    error = now
    for _ in range(REWEIGHTING_ROUNDS):
        solution = np.linalg.lstsq(past * weight[:, np.newaxis], now * weight, rcond=None)[0]
        error = now - past @ solution
        scale = 1.4826 * float(np.median(np.abs(error)))
        weight = 1 / np.maximum(1.0, np.abs(error) / max(2 * scale, 1e-300))
    return error
