"""Lines of an FRF that were smoothed over their neighbours."""

from __future__ import annotations

import numpy as np

from acquisition.frf import Frf

FEWEST = 128
"""Lines that are too few to tell."""
NEAR, FAR = (0.85, 0.95), (0.45, 0.55)
"""Times, as shares of the record, just before the hit comes round again, and as far from it as can be."""
LOUDER = 2.0
"""Times that the noise near the hit is that far from it where lines were smoothed; of three it is 2.3 and more."""
LOUDEST = 0.1
"""Share of the hit itself above which what comes before it is no noise: an FRF whose phase is conjugated."""
LEAKS = 10.0
"""Least level that means anything, over what the taper lets through of the hit."""


def is_smoothed(frf: Frf) -> bool:
    """Whether the noise of neighbouring lines is alike, as a mean over them, or a Hann window on them, makes it.

    To smooth the lines is to lay a window over the impulse response that falls away from the hit on both sides. What
    rings decays after the hit, and noise is the same everywhere, so that nothing else leaves more just before the hit
    than half a record away from it. Told of an evenly spaced axis only, and only where there is noise.
    Source: Bendat & Piersol, Random Data, ch. 11 (smoothing over frequency as a window over lag).
    """
    frf = frf.in_band(frf.usable_band)
    frequency, steps = frf.frequency, np.diff(frf.frequency)
    if frequency.size < FEWEST or np.ptp(steps) > 1e-3 * steps[0]:
        return False
    taper = np.hanning(frequency.size + 2)[1:-1] ** 2
    response = np.abs(np.fft.ifft(frf.accelerance * taper)) ** 2
    near, far = (float(np.mean(response[_part(share, response.size)])) for share in (NEAR, FAR))
    leaks = LEAKS * ((1 - NEAR[1]) * response.size) ** -10
    return bool(near > LOUDER**2 * far and leaks < near / np.max(response) < LOUDEST**2)


def _part(share: tuple[float, float], size: int) -> slice:
    return slice(round(share[0] * size), round(share[1] * size))
