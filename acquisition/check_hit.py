"""The verdict on one hit, from its time signals alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from acquisition.hit import Hit, HitFlags
from acquisition.pulse import Pulse, find_pulse

RAIL_RUN = 3
"""Samples in a row at a rail that make an overload."""
SOFT_SHARE_OF_SCALE = 0.02
"""A pulse below this share of the force range is too soft: the converter's steps show."""
SOFT_NOISE_RATIO = 20.0
"""A pulse below this many times the baseline's rms is too soft."""
DOUBLE_SHARE = 0.03
"""A second peak above this share of the first ..."""
DOUBLE_NOISE_RATIO = 6.0
"""... and above this many times the baseline's rms is a double hit."""
DECAYED_SHARE = 0.02
"""rms of the last tenth of the response against that of the loudest: above this and twice the noise it was cut off."""


def check_hit(hit: Hit) -> HitFlags:
    """All that is wrong with a hit; falsy when it may be averaged.

    Rails are known from ADC codes; a recording without codes is taken as overloaded where its extreme value
    stands exactly equal in a run of at least 3 samples (inferred); what the device reports as overloaded is.
    Source: ISO 7626-5 practice.
    """
    flags = _overloads(hit)
    if hit.lost_scans:
        flags |= HitFlags.LOST_SCANS
    if _is_swapped(hit):
        return flags | HitFlags.SWAPPED_CHANNELS
    pulse = find_pulse(hit)
    if pulse is None:
        return flags | HitFlags.NO_HIT
    if _is_soft(hit, pulse):
        flags |= HitFlags.TOO_SOFT
    if _second_peak(pulse) > max(DOUBLE_SHARE * pulse.peak, DOUBLE_NOISE_RATIO * pulse.baseline_rms):
        flags |= HitFlags.DOUBLE_HIT
    if _is_cut_off(hit):
        flags |= HitFlags.NOT_DECAYED
    return flags


def _overloads(hit: Hit) -> HitFlags:
    signals = hit.codes if hit.codes is not None else (hit.force, hit.acceleration)
    flags = HitFlags.OK
    for i, flag in enumerate((HitFlags.OVERLOAD_FORCE, HitFlags.OVERLOAD_RESPONSE)):
        if hit.codes is not None and hit.channels is not None:
            rails = set(hit.channels[i].rails)
        else:
            rails = {signals[i].min(), signals[i].max()} - {np.median(signals[i])}  # a resting value is no rail
        if hit.overload >> i & 1 or any(_longest_run(signals[i] == rail) >= RAIL_RUN for rail in rails):
            flags |= flag
    return flags


def _longest_run(at_rail: NDArray[np.bool_]) -> int:
    edges = np.flatnonzero(np.diff(np.concatenate(([0], at_rail.astype(np.int8), [0]))))
    return int(np.max(edges[1::2] - edges[::2], initial=0))


def _is_swapped(hit: Hit) -> bool:
    """The response is one short pulse of one sign while the force swings through both."""
    force, response = hit.force - np.median(hit.force), hit.acceleration - np.median(hit.acceleration)
    sided = min(response.max(), -response.min()) < 0.1 * np.max(np.abs(response))
    swings = min(force.max(), -force.min()) > 0.3 * np.max(np.abs(force))
    return bool(sided and swings and _duration(force) > 3 * _duration(response))


def _is_soft(hit: Hit, pulse: Pulse) -> bool:
    threshold = SOFT_NOISE_RATIO * pulse.baseline_rms
    if hit.channels is not None:
        force = hit.channels[0]
        threshold = max(threshold, SOFT_SHARE_OF_SCALE * force.full_scale / abs(force.sensitivity))
    return pulse.peak < threshold


def _second_peak(pulse: Pulse) -> float:
    """Largest force later than one pulse width after the pulse has first fallen below 5 % of its peak (N)."""
    return float(np.max(pulse.force[2 * pulse.end - pulse.start :], initial=0.0))


def _duration(signal: NDArray[np.float64]) -> int:
    """Number of samples that hold the middle 90 % of the energy."""
    energy = np.cumsum(signal**2)
    low, high = np.searchsorted(energy, [0.05 * energy[-1], 0.95 * energy[-1]])
    return int(high - low) + 1


def _is_cut_off(hit: Hit) -> bool:
    levels = [float(np.std(tenth)) for tenth in np.array_split(hit.acceleration, 10)]
    quiet = hit.acceleration[: int(0.8 * hit.pre_trigger)]
    noise = float(np.std(quiet)) if quiet.size >= 8 else 0.0
    return levels[-1] > max(DECAYED_SHARE * max(levels), 2 * noise)
