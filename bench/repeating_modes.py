"""Trust in modes on public structures of which several points were measured, each file read by a command.

    python bench/repeating_modes.py FOLDER

FOLDER as for public_files.py. A mode repeats where half of the FRFs of its structure have it within 0.5 %. Prints the
table of docs/modal.md; what is not in FOLDER is skipped.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from public_files import BLADE, DYNAMIC_STRUCTURE, FILES, PLATE_POINTS, SIGNALS, VIBROMETER, WING, Reading, read

NEAR, OFTEN = 0.005, 0.5
"""Relative distance within which two modes may be the same; share of the FRFs that have a mode which repeats."""
STRUCTURES = {
    "blade": f"{BLADE}/",
    "plate": PLATE_POINTS,
    "structure of `test_DS`": DYNAMIC_STRUCTURE,
    "the wing, another day": f"{WING}/first_lab/",
    "tool": f"{SIGNALS}/ExperimentalModalAnalysis/",
    "beam before a vibrometer": f"{VIBROMETER}/*reflection/data/",
}
"""What was measured, and how the patterns of its files begin."""


def readings(folder: Path, begin: str) -> list[Reading]:
    """What is read of a structure."""
    entries = [entry for entry in FILES if entry.pattern.startswith(begin)]
    files = [(file, entry.words(folder)) for entry in entries for file in sorted(folder.glob(entry.pattern))]
    return [reading for file, words in files if not (reading := read(file, words)).refusal]


def repeats(frequency: float, structure: list[Reading]) -> bool:
    """Whether a mode (Hz) repeats."""
    has = [any(abs(other / frequency - 1) < NEAR for other, _ in reading.modes) for reading in structure]
    return float(np.mean(has)) >= OFTEN


def row(name: str, structure: list[Reading]) -> str:
    """Of the table."""
    told: dict[bool, list[bool]] = {True: [], False: []}
    for reading in structure:
        for frequency, trusted in reading.modes:
            told[repeats(frequency, structure)].append(trusted)
    shares = [f"{np.mean(trusted):.2f} of {len(trusted)}" if trusted else "none" for trusted in told.values()]
    return f"| {name} | {len(structure)} | {' | '.join(shares)} |"


def main() -> None:
    """Print the table."""
    if len(sys.argv) != 2 or not Path(sys.argv[1]).is_dir():
        sys.exit("give the folder of the public files: python bench/repeating_modes.py FOLDER")
    print("| structure | FRFs | trusted of those that repeat | trusted of the others |\n|---|---|---|---|")
    for name, begin in STRUCTURES.items():
        if structure := readings(Path(sys.argv[1]), begin):
            print(row(name, structure), flush=True)


if __name__ == "__main__":
    main()
