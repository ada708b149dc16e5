"""Compare a hit with the record at rest of the self-check."""

import numpy as np

from acquisition import Hit, HitFlags, HitVerdict
from acquisition.hit_fault import HIT_FAULTS
from lobewatch.tap.self_check import find_quiet_part
from lobewatch.tap.steady_line import find_steady_line

EXPLAINED_FLAGS = HitFlags.OK | HitFlags.NOT_DECAYED | HitFlags.INCONSISTENT
"""Flags that a steady vibration explains."""


def add_steady_vibration(verdict: HitVerdict, hit: Hit, baseline: Hit | None) -> HitVerdict:
    """Return the verdict on a hit, or STEADY_VIBRATION if one began after the self-check and explains its flags.

    baseline: record at rest, None without one.
    """
    if baseline is None or verdict.flags & ~EXPLAINED_FLAGS:
        return verdict
    quiet = find_quiet_part(hit)
    line = None if quiet is hit else find_steady_line(quiet)
    fault = HIT_FAULTS[HitFlags.STEADY_VIBRATION]
    if line is None or line.rms <= fault.limits["rest_ratio"] * float(np.std(baseline.acceleration)):
        return verdict
    return HitVerdict.from_findings({HitFlags.STEADY_VIBRATION: fault.state(finding=line.finding)})
