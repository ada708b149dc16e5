"""What rings after a hit whose force nobody measured."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from acquisition.hit import Hit
from acquisition.hits.pulse import baseline, samples_before

HIT_ENDS = 1.5e-3
"""Time after the beginning of a hit at which a decay begins (s): a hammer touches for 0.3 to 3 ms, and what is left of
its force then moves no mode (`modal.decay_spectra`)."""


def free_decay(hit: Hit) -> NDArray[np.float64]:
    """Acceleration (m/s^2) from HIT_ENDS after the hit began to the end of the record, less what it is at rest."""
    before = samples_before(hit)
    rest = float(np.mean(baseline(hit.acceleration, before)))
    return hit.acceleration[before + round(HIT_ENDS * hit.sample_rate) :] - rest


def resting_noise(hit: Hit) -> float:
    """rms of the acceleration about its mean at rest (m/s^2)."""
    return float(np.std(baseline(hit.acceleration, samples_before(hit))))
