"""Whether the hammer touched twice: a search for a second pulse as wide as the first, or somewhat narrower or wider."""

from __future__ import annotations

from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from acquisition.hits.pulse import Pulse

SHARE = 0.025
"""A second pulse above this share of the first makes a double hit: one of 3 % is found whatever its shape ..."""
CERTAINTY = 3.0
"""... and in noise: it is let pass only where it is smaller by this many times the noise of its height."""
WIDTHS = (0.7, 1.0, 1.4, 2.0)
"""Widths searched for, against that of the first pulse: a lighter touch lasts longer."""
RISE = 0.3
"""Its middle stands this share of its height above either side: 0.75 of a pulse, 0 where the force only recovers."""
FALSE_ALARM = 1e-3
"""Chance that noise alone passes for a second touch in one hit."""
BINS = 8
"""Samples a pulse width after averaging neighbours; fewer where it was recorded with fewer."""


@dataclass(frozen=True)
class SecondTouch:
    """A second pulse."""

    delay: float
    """Samples from the peak of the main pulse, negative where it came before."""
    share: float
    """Height over that of the main pulse (-)."""


def find_second_touch(pulse: Pulse) -> SecondTouch | None:
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
    step = max(1, width // BINS)
    force = _without_main_pulse(pulse, width)
    force = force[: force.size // step * step].reshape(-1, step).mean(axis=1)
    span = width / step
    near = (np.array([pulse.start - width, pulse.end + width]) / step).astype(int)
    limit = NormalDist().inv_cdf(1 - FALSE_ALARM / (force.size * len(WIDTHS)))
    best = SecondTouch(0.0, 0.0)
    for relative in WIDTHS:
        heights = _bump_heights(force, 1.4 * relative * span)
        outside, rise = np.concatenate((heights[:, : max(near[0], 0)], heights[:, near[1] :]), axis=1)
        if outside.size < BINS:
            continue
        standing = np.where(rise > RISE * outside, outside, 0.0)
        at = int(np.argmax(standing))
        share = float(standing[at]) / pulse.peak
        if share <= max(best.share, SHARE / (1 + CERTAINTY / limit)):
            continue  # whatever the noise is
        noise = 1.4826 * float(np.median(np.abs(outside - np.median(outside))))
        if standing[at] > limit * noise and share > SHARE - CERTAINTY * noise / pulse.peak:
            bin_ = at if at < near[0] else at - max(near[0], 0) + near[1]
            best = SecondTouch((bin_ + 0.5) * step - pulse.top, share)
    return best if best.share else None


def _without_main_pulse(pulse: Pulse, width: int) -> NDArray[np.float64]:
    """The force with a straight line where the main pulse stands, half its width on either side included."""
    low, high = max(pulse.start - width // 2, 0), min(pulse.end + width // 2, pulse.recorded.size)
    force = pulse.force
    before, after = force[max(low - width // 2, 0) : low], force[high : high + max(width // 2, 1)]
    ends = [float(np.mean(side)) if side.size else None for side in (before, after)]
    left, right = (end if end is not None else opposite or 0.0 for end, opposite in (ends, ends[::-1]))
    force[low:high] = np.linspace(left, right, high - low)
    return force


def _bump_heights(force: NDArray[np.float64], foot: float) -> NDArray[np.float64]:
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
