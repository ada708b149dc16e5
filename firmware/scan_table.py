"""Write a table of scans for boards without a converter: `python firmware/scan_table.py MACHINE TABLE`."""

from __future__ import annotations

import argparse
import struct
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquisition import HammeredStructure, Hammering
from acquisition.emulation import quantise
from lobewatch.machine.folder import MachineFolder
from lobewatch.tap.emulated_spindle import EMULATED_CHANNELS, EMULATED_SAMPLE_RATE, build_structure

EVENTS = 16
"""Largest number of events in a table."""


def write_table(
    path: Path, codes: NDArray[np.int32], *, by_clock: bool = False, events: Sequence[tuple[int, str]] = ()
) -> None:
    """Write scans (2, n) of force and acceleration, played over and over: by the clock, or as fast as the host reads.

    `events` are pairs of scans since power-on and an event letter of firmware/boards/simulated.h; 16 at most.
    """
    happening = [*events, *[(0, "\0")] * (EVENTS - len(events))]
    header = struct.pack("<4sII", b"TAPS", codes.shape[1], by_clock)
    header += b"".join(struct.pack("<II", scan, ord(letter)) for scan, letter in happening)
    path.write_bytes(header + codes.T.astype("<i4").tobytes())


def main() -> None:
    """Write the table of a machine's spindle that is tapped twice a second."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("machine", type=Path, help="folder with a spindle in its machine.toml")
    parser.add_argument("table", type=Path, help="file to write")
    parser.add_argument("--seconds", type=float, default=60.0, help="length, up to 80 s fit into QEMU's board")
    parser.add_argument("--seed", type=int, default=1, help="of the random numbers")
    parser.add_argument("--by-clock", action="store_true", help="played at the rate, not as fast as the host reads")
    options = parser.parse_args()
    spindle = MachineFolder(options.machine).machine.spindle
    if spindle is None:
        parser.error(f"{options.machine}: machine.toml has no [spindle] table: there is nothing to tap")
    structure = build_structure(spindle.build(), spindle.damping_ratio)
    tapper = HammeredStructure(structure, EMULATED_SAMPLE_RATE, np.random.default_rng(options.seed), Hammering())
    codes = quantise(tapper(0, round(options.seconds * EMULATED_SAMPLE_RATE)), EMULATED_CHANNELS)
    write_table(options.table, codes, by_clock=options.by_clock)


if __name__ == "__main__":
    main()
