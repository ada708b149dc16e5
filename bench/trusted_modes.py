"""Trust in modes, counted on public measurements: do sensors of the same hits agree, and are modes trusted that repeat?

    python bench/trusted_modes.py FOLDER [START [STEP [COUNT]]]

FOLDER holds MAT files of SignalCalc (H1_2, H1_3, ... in g/N of the same hits), e.g. data/sec_lab of
Renkinios/MECA0062-1_vibration_testing. COUNT of its sorted files are read, from START on by STEP (0, 4 and 20: those
that the rules were chosen on). Prints rows of the tables of docs/studies/modal.md: each FRF by itself, then with the
other sensors of the same hits, and whether modes trusted only by these repeat at other points.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from signalcalc import measured_frfs

from modal import Mode, Trust, assess_trust, fit_modes, match_modes

NEAR = 0.005
"""Relative distance within which two modes may be the same."""
OFTEN = 0.25
"""Share of all FRFs that have a mode which repeats; all sensors of the same hits will do, too."""
MOVED = (0.965, 0.98, 1.02, 1.035)
"""Factors on the frequencies of other sensors, so that what is found again is found by chance."""
Hits = list[list[Mode]]
"""Modes of each sensor."""


def has(modes: list[Mode], frequency: float) -> bool:
    return any(abs(mode.frequency / frequency - 1) < NEAR for mode in modes)


def repeats(mode: Mode, hits: Hits, files: list[Hits]) -> bool:
    share = np.mean([has(sensor, mode.frequency) for other in files for sensor in other])
    return bool(share >= OFTEN) or all(has(sensor, mode.frequency) for sensor in hits)


def nearest(modes: list[Mode], mode: Mode) -> Mode | None:
    near = [other for other in modes if abs(other.frequency / mode.frequency - 1) < NEAR]
    return min(near, key=lambda other: abs(other.frequency - mode.frequency), default=None)


def agreements(hits: Hits) -> Iterator[NDArray[np.bool_]]:
    """Yield for each pair of trusted modes whether f and zeta agree within the joint uncertainty of their intervals."""
    trusted = [[mode for mode in sensor if assess_trust(mode) is Trust.TRUSTED] for sensor in hits]
    for some, others in combinations(trusted, 2):
        for mode in some:
            other = nearest(others, mode)
            if other is not None and nearest(some, other) is mode:
                reach = np.hypot(*(np.ptp(each.interval()[:2], axis=1) / 2 for each in (mode, other)))
                yield np.abs([mode.frequency - other.frequency, mode.damping_ratio - other.damping_ratio]) < reach


def is_trusted(mode: Mode) -> bool:
    return assess_trust(mode) is Trust.TRUSTED


def beside(hits: Hits, moved: float = 1.0) -> Hits:
    """Return the modes matched with the other sensors of the hits, whose frequencies are scaled by a factor."""
    away = [[mode.scaled(moved, 1.0, "") for mode in sensor] for sensor in hits]
    return [match_modes(sensor, away[:k] + away[k + 1 :]) for k, sensor in enumerate(hits)]


def row(files: list[Hits]) -> str:
    """Return a row of the table."""
    agree = np.array([pair for hits in files for pair in agreements(hits)])
    judged = [(repeats(mode, hits, files), is_trusted(mode)) for hits in files for sensor in hits for mode in sensor]
    again, once = ([trusted for repeated, trusted in judged if repeated is wanted] for wanted in (True, False))
    return (
        f"| {len(agree)} | {agree[:, 0].mean():.3f} | {agree[:, 1].mean():.3f} "
        f"| {np.mean(again):.3f} of {len(again)} | {np.mean(once):.3f} of {len(once)} |"
    )


def newly(files: list[Hits], looked: list[Hits]) -> Iterator[tuple[int, Mode, bool]]:
    """Modes that are not trusted by themselves, with the place of their file, and whether they are then."""
    for place, (alone, again) in enumerate(zip(files, looked, strict=True)):
        for before, now in zip(alone, again, strict=True):
            yield from (
                (place, mode, is_trusted(mode)) for mode, same in zip(now, before, strict=True) if not is_trusted(same)
            )


def share_of(files: list[Hits], looked: list[Hits]) -> float:
    """Return the share of modes that are trusted by matching only."""
    return float(np.mean([trusted for _, _, trusted in newly(files, looked)]))


def elsewhere(files: list[Hits], place: int, mode: Mode) -> float:
    """Share of the FRFs of other points that have a mode."""
    others = [sensor for other in files[:place] + files[place + 1 :] for sensor in other]
    return float(np.mean([has(sensor, mode.frequency) for sensor in others]))


def main() -> None:
    start, step, count = (*map(int, sys.argv[2:]), *(0, 4, 20)[len(sys.argv) - 2 :])
    paths = sorted(Path(sys.argv[1]).glob("*.mat"))[start::step][:count]
    files = [[fit_modes(frf) for frf in measured_frfs(path)] for path in paths]
    looked = [beside(hits) for hits in files]
    print("pairs, f agrees, zeta agrees, trusted of those that repeat, trusted of the others")
    print(f"{row(files)} each by itself\n{row(looked)} with the other sensors beside")
    share = np.array([elsewhere(files, place, mode) for place, mode, trusted in newly(files, looked) if trusted])
    few = [int(np.sum(share < least)) for least in (OFTEN, 0.1)]
    print(f"trusted by that alone: {share.size}, of them {few[0]} and {few[1]} in less than 1/4, 1/10 of other points")
    chance = [share_of(files, [beside(hits, factor) for hits in files]) for factor in MOVED]
    print(f"share of what is not trusted by itself: {share_of(files, looked):.3f}, by chance {max(chance):.3f} at most")


if __name__ == "__main__":
    main()
