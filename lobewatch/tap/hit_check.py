"""Evaluate a hit of a tap test against the record at rest, and average hits."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from acquisition import Circumstances, Hit, HitDecision, HitFlags, HitVerdict, TapTest, estimate_frf
from acquisition.hit_fault import HIT_FAULTS
from acquisition.hit_quality.decide_hits import average_decided_hits
from acquisition.hit_quality.evaluate_hit import compare_magnitude
from acquisition.tap_test import decide_flags
from lobewatch.tap.self_check import find_quiet_part
from lobewatch.tap.steady_line import MIN_LINE_POWER_SHARE, find_steady_line

N_FIRST_HITS = 3
"""Number of first good hits with which the strength of a response is compared, as in a mean."""
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
    if line is None or line.power_share <= MIN_LINE_POWER_SHARE:
        return verdict
    if line.rms <= fault.limits["rest_ratio"] * float(np.std(baseline.acceleration)):
        return verdict
    return HitVerdict.from_findings({HitFlags.STEADY_VIBRATION: fault.state(finding=line.finding)})


def add_loose_sensor(verdict: HitVerdict, hit: Hit, others: Sequence[Hit]) -> HitVerdict:
    """Return the verdict on a good hit, or INCONSISTENT if the first hits show that its response has become weak.

    others: earlier good hits. A mean follows a response that decreases from hit to hit, the first hits do not. They
    must agree with each other.
    """
    first, limit = others[:N_FIRST_HITS], HIT_FAULTS[HitFlags.INCONSISTENT].limits["mean_distance"]
    if verdict.flags or len(first) < N_FIRST_HITS or not hit.has_force:
        return verdict
    mean = estimate_frf(first)
    share = compare_magnitude(estimate_frf([hit]), mean)
    if share >= 1 - limit or any(abs(compare_magnitude(estimate_frf([one]), mean) - 1) > limit / 2 for one in first):
        return verdict
    figures = {"distance": 1 - share, "count": len(first), "limit": limit, "share": share}
    finding = HIT_FAULTS[HitFlags.INCONSISTENT].state("weaker", **figures)
    return HitVerdict.from_findings({HitFlags.INCONSISTENT: finding})


def evaluate_safely(evaluate: Callable[[], HitVerdict]) -> HitVerdict:
    """Evaluate a hit. If this fails, reject the hit as NOT_EVALUATED with the reason: one hit must not end a test."""
    try:
        return evaluate()
    except Exception as error:  # noqa: BLE001 - whatever it is, the next hit can be good
        failure = HIT_FAULTS[HitFlags.NOT_EVALUATED].state(reason=f"{type(error).__name__}: {error}")
        return HitVerdict.from_findings({HitFlags.NOT_EVALUATED: failure})


def average_hits(
    tap_id: str,
    about: Circumstances,
    hits: Sequence[Hit],
    flags: Sequence[HitFlags],
    decisions: tuple[HitDecision, ...] = (),
) -> TapTest:
    """Average the good hits to a tap test, each as one sensor recorded it. ValueError if none is good."""
    frf, _ = average_decided_hits(hits, decide_flags(flags, decisions))
    hits = tuple(replace(hit, cross_hit=None) for hit in hits)
    return TapTest(tap_id, about, frf, hits, tuple(flags), decisions=decisions)


def format_peak(hit: Hit) -> str:
    """Format the largest force of a hit, or without a force sensor its largest acceleration, with the unit."""
    if hit.has_force:
        return f"{hit.force.max():.0f} N"
    return f"{np.max(np.abs(hit.acceleration - np.median(hit.acceleration))):.0f} m/s²"
