"""Agreement of repeated measurements of the same points: do f, zeta and K differ by no more than their intervals?

    python bench/repeated_points.py FOLDER

FOLDER holds test_DS of TimVrtac/Impact-testing-DS: F1.npy, F1_gr1.npy, ... are repeated measurements of point F1, each
three hits with a force and three accelerations (g, 20 kHz). Prints a row of the table of docs/studies/modal.md: trusted
modes of two measurements within 0.5 %, the share of them that agree within the root sum of squares of both 95 %
half-widths, and the median of their distance over it.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from trusted_modes import is_trusted, nearest

from acquisition import STANDARD_GRAVITY, Hit, estimate_frf
from modal import Mode, fit_modes

POINTS, AXES, RATE = ("F1", "F2", "F3"), (1, 2, 3), 20000.0


def trusted_modes(hits: Sequence[Hit]) -> list[Mode]:
    return [mode for mode in fit_modes(estimate_frf(hits), hits=hits) if is_trusted(mode)]


def repetitions(folder: Path) -> Iterator[list[list[Mode]]]:
    """Yield the trusted modes of all measurements of one point and axis."""
    for point in POINTS:
        records = [np.load(file) for file in sorted(folder.glob(f"{point}*.npy"))]
        for axis in AXES:
            hits = [[Hit(hit[0], STANDARD_GRAVITY * hit[axis], RATE) for hit in record] for record in records]
            yield [trusted_modes(each) for each in hits]


def distances(some: list[Mode], others: list[Mode]) -> Iterator[NDArray[np.float64]]:
    """Yield the distances of f, zeta and K of two measurements over their joint half-widths."""
    for mode in some:
        other = nearest(others, mode)
        if other is not None and nearest(some, other) is mode:
            reach = np.hypot(*(np.ptp(each.interval(), axis=1) / 2 for each in (mode, other)))
            apart = mode.frequency - other.frequency, mode.damping_ratio - other.damping_ratio
            yield np.abs([*apart, mode.stiffness - other.stiffness]) / reach


def main() -> None:
    """Print the row."""
    if len(sys.argv) != 2 or not Path(sys.argv[1]).is_dir():
        sys.exit("give the folder of the recordings: python bench/repeated_points.py FOLDER")
    pairs = [pair for one in repetitions(Path(sys.argv[1])) for pair in combinations(one, 2)]
    every = np.array([distance for pair in pairs for distance in distances(*pair)])
    agree, middle = np.mean(every < 1, axis=0).round(3), np.median(every, axis=0).round(2)
    print(f"| {len(every)} | {' | '.join(map(str, agree))} | {' | '.join(map(str, middle))} |")


if __name__ == "__main__":
    main()
