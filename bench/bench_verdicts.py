"""Hit verdicts beside pyFRF's checks on the same labelled hits, and detection of small double hits.

    python -m pip install -e .[bench]      (in an environment of its own)
    python bench/bench_verdicts.py

Ours: `evaluate_hit` with the mean of the session. Theirs: `FRF.is_data_ok` with its own limits. Second table: share of
further touches refused, by size, distance and noise; and the error in K where all of ten hits have such a touch and are
averaged, against the same hits without it.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from importlib.metadata import version

import numpy as np
from labelled_hits import (
    HOLD_OUT,
    KINDS,
    SET,
    TOUCHES,
    Blow,
    Session,
    Setting,
    labelled_hits,
    second_blow,
    session,
)
from pyFRF import FRF
from threadpoolctl import threadpool_limits

from acquisition import Hit, HitFlags, estimate_frf, evaluate_hit
from modal import fit_modes

SESSIONS = 100
LIMITS = (1e-3, 3e-3, 0.01, 0.03, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0, 1.5, 2.5, 4.0, 6.0, 10.0, np.inf)
"""Limits of pyFRF's check for a double impact; the first is its default."""
SHARES = (0.01, 0.03, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0)
GAPS = (0.5, 1.0, 3.0, 10.0, 30.0)
"""Between the 5 % levels of the two pulses, in widths of the first."""
NOISES = (0.05, 5.0)
"""rms (N)."""
PEAK, WIDTH = 200.0, 0.65e-3
"""Peak (N) and width (s) of the first pulse."""
BAND = (1300.0, 2200.0)
"""Band with the mode whose K is followed (Hz)."""


def compare(setting: Setting, seed: int) -> None:
    """Compare pyFRF with its own limit, and with one that rejects at most 0.5 % of these good hits."""
    theirs = FRF(int(setting.sample_rate), fft_len=setting.record)
    count, refused, named, overflow = (Counter[str]() for _ in range(4))
    double: dict[str, list[int]] = {kind: [] for kind in KINDS | TOUCHES}
    for one in labelled_hits(setting, SESSIONS, seed, KINDS | TOUCHES):
        flags = evaluate_hit(one.hit, one.mean).flags
        force, response = one.hit.force, one.hit.acceleration
        count[one.kind] += 1
        refused[one.kind] += bool(flags)
        named[one.kind] += bool(flags & one.expected)
        clipped = not theirs.is_data_ok(force, response, double_impact_limit=np.inf)
        overflow[one.kind] += clipped
        passes = [theirs.is_data_ok(force, response, double_impact_limit=limit) for limit in LIMITS]
        double[one.kind].append(len(LIMITS) if clipped else passes.index(True))
    levels = range(len(LIMITS))
    best = next((i for i in levels if np.mean(np.array(double["good"]) > i) <= 0.005), len(LIMITS) - 1)
    print(f"pyFRF {version('pyFRF')}: own limit {LIMITS[0]:g}, tuned limit {LIMITS[best]:.2g}\n")
    print("| kind | hits | refused | named | pyFRF, own limit | pyFRF, tuned | of it overflow |\n" + "|---" * 7 + "|")
    for kind, n in count.items():
        right = f"{named[kind] / n:.1%}" if named[kind] else ""
        own, tuned = (np.mean(np.array(double[kind]) > i) for i in (0, best))
        shares = f"{refused[kind] / n:.1%} | {right} | {own:.1%} | {tuned:.1%} | {overflow[kind] / n:.1%}"
        print(f"| {kind} | {n} | {shares} |")


def room(noise: float, random: np.random.Generator) -> Session:
    return replace(session(SET, random, 0), background="quiet", width=WIDTH, force_noise=noise)


def touched(one: Session, share: float, gap: float) -> Hit:
    first = Blow(PEAK, WIDTH)
    blows = [first, second_blow(one, first, share, gap)] if share else [first]
    clean = one.signal(blows, SET.structure)
    return one.take(clean + one.noise(clean.shape[1]))


def detection(share: float, gap: float, noise: float, hits: int = 100) -> float:
    one = room(noise, np.random.default_rng(1))
    return float(
        np.mean([bool(evaluate_hit(touched(one, share, gap)).flags & HitFlags.DOUBLE_HIT) for _ in range(hits)])
    )


def ten_hits(seed: int, share: float, gap: float) -> list[Hit]:
    one = room(0.05, np.random.default_rng(seed))
    return [touched(one, share, gap) for _ in range(10)]


def stiffness_error(share: float, gap: float) -> float:
    """Median of five."""
    errors = []
    for seed in range(5):
        with_it, without = (
            max(fit_modes(estimate_frf(hits), BAND), key=lambda mode: 1 / mode.stiffness).stiffness
            for hits in (ten_hits(seed, share, gap), ten_hits(seed, 0.0, gap))
        )
        errors.append(with_it / without - 1)
    return float(np.median(errors))


def main() -> None:
    for name, setting, seed in (("set", SET, 1), ("hold-out", HOLD_OUT, 2)):
        print(f"\n{name}: {setting.sample_rate:g} Hz, {setting.record} samples, {SESSIONS} sessions\n")
        compare(setting, seed)
    head = "| second peak | " + " | ".join(f"{gap:g} widths" for gap in GAPS) + " |\n" + "|---" * (len(GAPS) + 1) + "|"
    for noise in NOISES:
        print(f"\nrefused as double hit, first peak {PEAK:g} N, noise {noise:g} N rms\n\n{head}")
        for share in SHARES:
            cells = " | ".join(f"{detection(share, gap, noise):.0%}" for gap in GAPS)
            print(f"| {share:.0%} = {share * PEAK / noise:.3g} x noise | {cells} |")
    print(f"\nerror in K with ten such hits\n\n{head}")
    for share in SHARES[: SHARES.index(0.5) + 1]:  # above, the usable band ends at the hole
        print(f"| {share:.0%} | " + " | ".join(f"{stiffness_error(share, gap):+.2%}" for gap in GAPS) + " |")


if __name__ == "__main__":
    with threadpool_limits(limits=1):
        main()
