"""An exponential window that a response was recorded under and nobody told of."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from acquisition.hit import Hit
from acquisition.hits.pulse import samples_before

QUIETER = 2.0
"""Times that the noise before the hit is that of the last tenth where a window lies over both; chance reaches 1.3."""
FEWEST = 32
"""Samples before the hit that are too few to tell."""


def hidden_window(hits: Sequence[Hit]) -> float | None:
    """Time constant of the window over the responses of these hits (s), about; None where there is no sign of one.

    Nothing that rings after a hit can make its end quieter than it was before it: a window does. The noise is that of
    differences of neighbouring samples, which hum hardly enters; the window falls from its middle before the hit to
    that of the last tenth. An end of zeros is padding and tells nothing.
    """
    falls = [fall for fall in map(_fall, hits) if fall is not None]
    if not falls:
        return None
    ratio, apart = np.median(falls, axis=0)
    return float(apart / np.log(ratio)) if ratio > QUIETER else None


def _fall(hit: Hit) -> tuple[float, float] | None:
    """Noise before the hit over that at the end, and the time between (s); None where one of them cannot be told."""
    before, tenth = int(0.8 * samples_before(hit)), hit.acceleration.size // 10
    if min(before, tenth) < FEWEST:
        return None
    quiet, end = (np.std(np.diff(part)) for part in (hit.acceleration[:before], hit.acceleration[-tenth:]))
    apart = (hit.acceleration.size - tenth / 2 - before / 2) / hit.sample_rate
    return (float(quiet / end), apart) if end > 0 else None
