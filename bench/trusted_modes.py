"""Trust in modes, counted on public measurements: do sensors of the same hits agree, and are modes trusted that repeat?

    python bench/trusted_modes.py FOLDER [START [STEP]]

Nothing is fetched: FOLDER holds MAT files as SignalCalc writes them (H1_2, H1_3, ... in g/N of the same hits), e.g.
data/sec_lab of Renkinios/MECA0062-1_vibration_testing. Of its files, sorted, 20 from START on by STEP are taken (0 and
4: those that the rules were chosen on). Prints a row of the table of docs/modal.md.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from signalcalc import measured_frfs

from modal import Mode, Trust, fit_modes, trust_of

FILES = 20
NEAR = 0.005
"""Relative distance within which two modes may be the same."""
OFTEN = 0.25
"""Share of all FRFs that have a mode which repeats; all sensors of the same hits will do, too."""
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
    """Whether f and zeta of each pair of trusted modes agree within the root sum of squares of their intervals."""
    trusted = [[mode for mode in sensor if trust_of(mode) is Trust.TRUSTED] for sensor in hits]
    for some, others in combinations(trusted, 2):
        for mode in some:
            other = nearest(others, mode)
            if other is not None and nearest(some, other) is mode:
                reach = np.hypot(*(np.ptp(each.interval()[:2], axis=1) / 2 for each in (mode, other)))
                yield np.abs([mode.frequency - other.frequency, mode.damping_ratio - other.damping_ratio]) < reach


def main() -> None:
    start = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    step = int(sys.argv[3]) if len(sys.argv) > 3 else 4
    paths = sorted(Path(sys.argv[1]).glob("*.mat"))[start::step][:FILES]
    files = [[fit_modes(frf) for frf in measured_frfs(path)] for path in paths]
    agree = np.array([pair for hits in files for pair in agreements(hits)])
    judged = [
        (repeats(mode, hits, files), trust_of(mode) is Trust.TRUSTED)
        for hits in files
        for sensor in hits
        for mode in sensor
    ]
    again, once = ([trusted for repeated, trusted in judged if repeated is wanted] for wanted in (True, False))
    print("pairs, f agrees, zeta agrees, trusted of those that repeat, trusted of the others")
    print(
        f"| {len(agree)} | {agree[:, 0].mean():.3f} | {agree[:, 1].mean():.3f} "
        f"| {np.mean(again):.3f} of {len(again)} | {np.mean(once):.3f} of {len(once)} |"
    )


if __name__ == "__main__":
    main()
