"""How long a structure rings after a hit."""

from __future__ import annotations

import numpy as np

from acquisition.hit import Hit
from acquisition.pulse import find_pulse

WINDOWS = 200
"""Pieces of a record whose rms make the envelope."""
NOISE_RATIO = 3.0
"""The envelope counts while its rms is above this many times that of the baseline."""


def ring_down(hit: Hit) -> float:
    """Time constant of the slowest decay that stands out of the noise in the response of a hit (s).

    The slope of the logarithm of the response's envelope over the later half of what is visible; inf where nothing
    falls, 0 where nothing rings. Raises ValueError for a hit without a pulse.
    """
    pulse = find_pulse(hit)
    if pulse is None:
        raise ValueError("a hit has no force pulse; its ring-down cannot be seen")
    width = max(hit.force.size // WINDOWS, 8)
    quiet = hit.acceleration[: max(pulse.start, 1)]
    ringing = hit.acceleration[min(pulse.end, hit.force.size - 1) :] - np.mean(quiet)
    pieces = ringing[: ringing.size // width * width].reshape(-1, width)
    rms = np.sqrt(np.mean(pieces**2, axis=1))
    loud = np.flatnonzero(rms > NOISE_RATIO * np.std(quiet))
    if not loud.size:
        return 0.0
    kept = rms[: int(loud[-1]) + 1]
    late = kept[kept.size // 2 :] if kept.size >= 4 else kept
    if late.size < 2:
        return width / hit.sample_rate
    slope = np.polyfit(np.arange(late.size) * width / hit.sample_rate, np.log(np.maximum(late, 1e-300)), 1)[0]
    return float(-1 / slope) if slope < 0 else float("inf")
