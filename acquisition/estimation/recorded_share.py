"""How much of the time that the spacing of lines stands for was recorded."""

from __future__ import annotations

import numpy as np

from acquisition.frf import Frf

PARTS = 40
"""Parts of the time that are looked at."""
FALL = 10.0
"""Times that the end of what was recorded is what follows it, and that it falls faster there than just before."""
FEWEST = 160
"""Lines that are too few to tell."""
LEAKS = 1e-7
"""Share of the hit below which a level means nothing."""


def recorded_share(frf: Frf) -> float:
    """Share (0 to 1) of one over the line spacing that was recorded; the rest is zeros, and 1 where nothing shows it.

    A record that is filled up with zeros has lines nearer to each other than one over its length, and its impulse
    response, noise and all, ends at once where the zeros begin; ringing falls no faster there than before. Told of an
    evenly spaced axis only.

    >>> time = np.arange(1000)
    >>> decay = np.exp(-time / 200.0) * np.cos(time) + np.random.default_rng(1).normal(0.0, 0.01, 1000)
    >>> spectrum = np.fft.rfft(np.append(decay, np.zeros(1000)))[1:-1]  # filled up with as many zeros
    >>> round(recorded_share(Frf(np.arange(1.0, 1000.0), spectrum)), 1)
    0.5
    """
    frf = frf.in_band(frf.usable_band)
    frequency, steps = frf.frequency, np.diff(frf.frequency)
    if frequency.size < FEWEST or np.ptp(steps) > 1e-3 * steps[0]:
        return 1.0
    taper = np.hanning(frequency.size + 2)[1:-1] ** 2
    response = np.abs(np.fft.ifft(frf.accelerance * taper))
    levels = np.array([np.sqrt(np.mean(part**2)) for part in np.array_split(response, PARTS)])
    for end in range(3, PARTS - 4):
        last, zeros = levels[end - 1], np.max(levels[end + 1 : -2])
        before = levels[end - 3] / last
        if last > max(FALL * zeros * max(before, 1.0), LEAKS * np.max(response)):
            return (end + 0.5) / PARTS
    return 1.0
