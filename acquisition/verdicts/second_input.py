"""Whether a free decay was hit again: a second touch breaks the linear prediction that the decay otherwise obeys."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

ORDER = 32
"""Samples that the next one is predicted from: two for each mode, and more of them for noise."""
SHORTEST = 8 * ORDER
"""Samples of a decay below which nothing is told."""
SPAN = 3e-4
"""Time over which errors of the prediction are taken together (s): half of a short pulse."""
RISE_TIME = 1e-3
"""Time in which a second touch has risen (s): errors are compared with those before it."""
RISE = 2.0
"""Times the largest error before it: what is not linear in a structure errs most while it moves most."""
FALSE_ALARM = 1e-4
"""Chance that noise alone passes for a second touch in one decay ..."""
MARGIN = 1.25
"""... times this, for its errors are not quite independent."""
ROUNDS = 4
"""Rounds in which errors that stand out lose weight."""

Signal = NDArray[np.float64]


def second_input(decay: Signal, sample_rate: float, noise: float) -> float | None:
    """Time (s) from the first sample of a free decay (m/s^2) at which it was hit again; None where nothing shows it.

    noise: rms at rest (m/s^2); what has fallen below three times that does not count. What comes within 1 ms is not
    told from a decay that is not linear. Source of the prediction: Makhoul (1975), Proc. IEEE 63, 561.
    """
    visible = _visible(decay, max(round(1e-3 * sample_rate), 4), noise)
    if visible.size < SHORTEST:
        return None
    error = _prediction_error(visible)
    scale = 1.4826 * float(np.median(np.abs(error)))
    span, rise = max(round(SPAN * sample_rate), 1), max(round(RISE_TIME * sample_rate), 1)
    level = np.sqrt(np.convolve(error**2, np.full(span, 1 / span), "valid"))
    if scale == 0 or level.size <= rise:
        return None
    by_chance = MARGIN * scale * np.sqrt(scipy.special.chdtri(span, FALSE_ALARM / level.size) / span)
    before = np.maximum.accumulate(level)[:-rise]
    above = np.flatnonzero(level[rise:] > np.maximum(by_chance, RISE * before))
    return float(above[0] + rise + ORDER) / sample_rate if above.size else None


def _visible(decay: Signal, width: int, noise: float) -> Signal:
    """The decay up to where it is lost in noise."""
    pieces = decay[: decay.size // width * width].reshape(-1, width)
    loud = np.flatnonzero(np.sqrt(np.mean(pieces**2, axis=1)) > 3 * noise)
    return decay[: (int(loud[-1]) + 1) * width] if loud.size else decay[:0]


def _prediction_error(signal: Signal) -> Signal:
    """What the samples before it do not tell of each sample, by a prediction that outliers do not bend."""
    past = np.lib.stride_tricks.sliding_window_view(signal[:-1], ORDER)
    now, weight = signal[ORDER:], np.ones(signal.size - ORDER)
    error = now
    for _ in range(ROUNDS):
        solution = np.linalg.lstsq(past * weight[:, np.newaxis], now * weight, rcond=None)[0]
        error = now - past @ solution
        scale = 1.4826 * float(np.median(np.abs(error)))
        weight = 1 / np.maximum(1.0, np.abs(error) / max(2 * scale, 1e-300))
    return error
