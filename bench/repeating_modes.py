"""Trust in modes on public structures of which several points were measured, each file read by a command.

    python bench/repeating_modes.py FOLDER

FOLDER as for public_files.py. A mode repeats if half of the FRFs of its structure contain it within 0.5 %. Each file is
read by itself, and then next to the others that are read with the same options. Prints the table of
docs/studies/modal.md. Files that are not in FOLDER are skipped.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from public_files import BLADE, DYNAMIC_STRUCTURE, FILES, PLATE_POINTS, SIGNALS, VIBROMETER, WING, Reading, read

NEAR, OFTEN = 0.005, 0.5
"""Relative distance within which two modes may be the same; share of the FRFs that have a mode which repeats."""
FEWEST = 2
"""Other files beside which one is read."""
STRUCTURES = {
    "blade": f"{BLADE}/",
    "plate": PLATE_POINTS,
    "structure of `test_DS`": DYNAMIC_STRUCTURE,
    "the wing, another day": f"{WING}/first_lab/",
    "tool": f"{SIGNALS}/ExperimentalModalAnalysis/",
    "beam before a vibrometer": f"{VIBROMETER}/*reflection/data/",
}
"""Structures and the patterns of their file names."""


def readings(folder: Path, begin: str) -> tuple[list[Reading], list[Reading]]:
    """Return the readings of a structure: each file by itself, and with the other files of its kind."""
    alone, looked = [], []
    for entry in FILES:
        if entry.pattern.startswith(begin):
            words = entry.words(folder)
            told = {
                file: reading
                for file in sorted(folder.glob(entry.pattern))
                if not (reading := read(file, words)).refusal
            }
            for file, reading in told.items():
                others = [word for other in told if other != file for word in ("--beside", str(other))]
                alone.append(reading)
                looked.append(read(file, words + others) if len(told) > FEWEST else reading)
    return alone, looked


def repeats(frequency: float, structure: list[Reading]) -> bool:
    """Return whether a mode (Hz) repeats."""
    has = [any(abs(other / frequency - 1) < NEAR for other, _ in reading.modes) for reading in structure]
    return float(np.mean(has)) >= OFTEN


def shares(structure: list[Reading], alone: list[Reading]) -> list[str]:
    """Return how many modes are trusted among those that repeat, and among the others."""
    told: dict[bool, list[bool]] = {True: [], False: []}
    for reading in structure:
        for frequency, trusted in reading.modes:
            told[repeats(frequency, alone)].append(trusted)
    return [f"{np.mean(trusted):.2f} of {len(trusted)}" if trusted else "none" for trusted in told.values()]


def row(name: str, alone: list[Reading], looked: list[Reading]) -> str:
    """Return a row of the table."""
    return f"| {name} | {len(alone)} | {' | '.join([*shares(alone, alone), *shares(looked, alone)])} |"


def main() -> None:
    """Print the table."""
    if len(sys.argv) != 2 or not Path(sys.argv[1]).is_dir():
        sys.exit("give the folder of the public files: python bench/repeating_modes.py FOLDER")
    heads = "trusted of those that repeat | of the others | beside the others | of the others"
    print(f"| structure | FRFs | {heads} |\n|---|---|---|---|---|---|")
    for name, begin in STRUCTURES.items():
        alone, looked = readings(Path(sys.argv[1]), begin)
        if alone:
            print(row(name, alone, looked), flush=True)


if __name__ == "__main__":
    main()
