"""Extract the free decay after a hit and estimate its time constant."""

import numpy as np

from acquisition.arrays import Floats
from acquisition.hit import Hit
from acquisition.hits.pulse import count_pre_hit_samples, extract_baseline, require_pulse

MAX_CONTACT_TIME = 1.5e-3
"""Time after the start of a hit at which the free decay begins (s).

A hammer touches for 0.3 to 3 ms; the rest of its force moves no mode (`modal.decay_spectra`).
"""


def extract_free_decay(hit: Hit) -> Floats:
    """Return the acceleration after the contact of the hammer, without its mean at rest.

    Parameters
    ----------
    hit
        Hit with a response.

    Returns
    -------
    ndarray, shape (m,)
        Acceleration (m/s^2) from 1.5 ms after the start of the hit to the end of the record.
    """
    before = count_pre_hit_samples(hit)
    rest = float(np.mean(extract_baseline(hit.acceleration, before)))
    return hit.acceleration[before + round(MAX_CONTACT_TIME * hit.sample_rate) :] - rest


def measure_rest_noise(hit: Hit) -> float:
    """Return the rms of the acceleration about its mean at rest (m/s^2)."""
    return float(np.std(extract_baseline(hit.acceleration, count_pre_hit_samples(hit))))


FINE_ENVELOPE_PIECES, COARSE_ENVELOPE_PIECES = 200, 8
"""Numbers of pieces of the envelope: many for a fast decay, few for one that outlasts them."""
ENVELOPE_NOISE_RATIO = 3.0
"""Level over the rms of the baseline above which the envelope counts."""


def estimate_decay_time(hit: Hit) -> float:
    """Estimate the time constant of the slowest visible decay in the response of a hit.

    It is the slope of the logarithm of the response's envelope over the later half of its visible part.

    Parameters
    ----------
    hit
        Hit with or without a force.

    Returns
    -------
    float
        Time constant (s); inf without decay, 0 without vibration.

    Raises
    ------
    ValueError
        If the force has no pulse.

    Examples
    --------
    >>> time = np.arange(-100, 4000) / 10240.0
    >>> force = 200 * np.where((time >= 0) & (time <= 1e-3), np.sin(np.pi * time / 1e-3) ** 4, 0.0)  # N
    >>> structure = Structure(np.array([500.0]), np.array([0.02]), np.array([2e7]))
    >>> response = 200 * structure.response(time, 1e-3)
    >>> noise = np.random.default_rng(1).normal(0.0, 0.1, time.size)
    >>> tau = estimate_decay_time(Hit(force, response + noise, 10240.0, pre_trigger=100))
    >>> round(tau * 1e3), round(1e3 / (0.02 * 2 * np.pi * 500.0))  # ms; 1 / (zeta w)
    (16, 16)
    """
    start, end = _locate_hit(hit)
    quiet = hit.acceleration[: max(start, 1)]
    ringing = hit.acceleration[min(end, hit.acceleration.size - 1) :] - np.mean(quiet)
    noise = ENVELOPE_NOISE_RATIO * float(np.std(quiet))
    width = max(hit.acceleration.size // FINE_ENVELOPE_PIECES, 8)
    loud = np.flatnonzero(_compute_rms_envelope(ringing, width) > noise)
    if not loud.size:
        return 0.0
    visible = ringing[: (int(loud[-1]) + 1) * width]
    constant = _fit_time_constant(visible, width)
    wide = visible.size // COARSE_ENVELOPE_PIECES
    if constant > 2 * wide:  # a slow mode: pieces shorter than its period would ripple
        constant = _fit_time_constant(visible, wide)
    return constant / hit.sample_rate


def _locate_hit(hit: Hit) -> tuple[int, int]:
    """Return the first sample of the hit and the first after it."""
    if not hit.has_force:
        before = count_pre_hit_samples(hit)
        return int(0.8 * before), before + round(MAX_CONTACT_TIME * hit.sample_rate)
    pulse = require_pulse(hit)
    return pulse.start, pulse.end


def _compute_rms_envelope(signal: Floats, width: int) -> Floats:
    pieces = signal[: signal.size // width * width].reshape(-1, width)
    return np.asarray(np.sqrt(np.mean(pieces**2, axis=1)))


def _fit_time_constant(signal: Floats, width: int) -> float:
    """Fit the time constant of the later half of a decay (samples)."""
    rms = _compute_rms_envelope(signal, width)
    late = rms[rms.size // 2 :] if rms.size >= 4 else rms
    if late.size < 2:
        return float(width)
    slope = np.polyfit(np.arange(late.size) * width, np.log(np.maximum(late, 1e-300)), 1)[0]
    return float(-1 / slope) if slope < 0 else float("inf")
