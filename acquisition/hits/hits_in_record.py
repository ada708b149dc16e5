"""The hits in one long record of a recorder that ran on while somebody hit several times."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from acquisition.hit import Hit

APART = 0.2
"""A pulse that comes sooner after the one before is a second touch: a hammer bounces within 0.1 s (s)."""
LEVEL = 0.1
"""A pulse is one where the force is above this share of the largest ..."""
NOISE_RATIO = 10.0
"""... and so many times its noise."""
BEFORE = 0.02
"""Kept before each pulse, at rest (s)."""
REST_SHARE = 0.02
"""The response is at rest where its rms over BEFORE is at most this share of the loudest after the hit before ..."""
REST_NOISE = 2.0
"""... or so many times that of the quietest tenth of the record."""
SHORTEST = 0.5
"""The last hit is left out where the record ends sooner after it than after this share of the others."""


def hits_in_record(record: Hit) -> list[Hit]:
    """Each hit of a record by itself, all of one length; the record itself where it holds one hit or none.

    A hit begins where the force rises at least 0.2 s after the pulse before and the response has come to rest; what
    comes sooner belongs to the hit before it, which is then a double hit, or has not decayed. All are as long as the
    shortest; nothing is interpolated.
    """
    starts = _starts(record)
    if len(starts) < 2:
        return [record]
    before = min(round(BEFORE * record.sample_rate), int(starts[0]))
    begins = starts - before
    lengths = np.diff(begins, append=record.acceleration.size)
    n = int(np.min(lengths[:-1]))
    if lengths[-1] < SHORTEST * n:
        begins = begins[:-1]
    n = min(n, int(np.min(record.acceleration.size - begins)))
    return [_part(record, int(a), n, before) for a in begins]


def _part(record: Hit, begin: int, size: int, before: int) -> Hit:
    inside = slice(begin, begin + size)
    force = record.force[inside] if record.has_force else record.force
    return replace(record, force=force, acceleration=record.acceleration[inside], pre_trigger=before)


def _starts(record: Hit) -> NDArray[np.intp]:
    """Samples at which the force rises at the beginning of a hit, or without one the response."""
    force, rate = record.signals[0] - np.median(record.signals[0]), record.sample_rate
    force = force if record.has_force else np.abs(force)
    noise = 1.4826 * float(np.median(np.abs(force)))
    loud = np.flatnonzero(force > max(LEVEL * float(np.max(force)), NOISE_RATIO * noise))
    rises = loud[np.diff(loud, prepend=-force.size) > APART * rate]
    if rises.size < 2:
        return rises
    width = max(round(BEFORE * rate), 8)
    levels = _levels(record.acceleration, width)
    quiet = REST_NOISE * float(np.quantile(levels, 0.1))
    kept = [rises[0]]
    for rise in rises[1:]:
        since = levels[int(kept[-1]) // width : max(int(rise) // width, int(kept[-1]) // width + 1)]
        now = float(np.std(record.acceleration[max(rise - width, 0) : max(rise - width // 5, 8)]))
        if now <= max(REST_SHARE * float(np.max(since)), quiet):
            kept.append(rise)
    return np.array(kept)


def _levels(response: NDArray[np.float64], width: int) -> NDArray[np.float64]:
    """rms about its mean of each stretch of so many samples; at least one."""
    count = max(response.size // width, 1)
    return np.array([float(np.std(part)) for part in np.array_split(response[: count * width], count)])
