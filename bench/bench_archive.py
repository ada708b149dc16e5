"""Measure a commit: a tap test of 10 hits x 2 x 65 536 stored safely, compared with a plain write by h5py.

    python bench/bench_archive.py [--rounds 15]

CPU time of the process, medians, all rows in turn in one run; files below the folder for temporary ones.
"""

from __future__ import annotations

import argparse
import os
import platform
import statistics
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from datetime import UTC, datetime
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory

import h5py
import numpy as np
from race import Race
from threadpoolctl import threadpool_limits

from acquisition import Channel, Circumstances, Hit, HitFlags, TapTest, estimate_frf
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder

HITS, SCANS, RATE = 10, 65_536, 102_400.0
CHANNELS = (Channel("force", 2.25e-3, 5.0), Channel("acceleration", 1.02e-3, 5.0))
PACKED = {"compression": "gzip", "compression_opts": 1, "shuffle": True, "fletcher32": True}
"""HDF5 options of a tap file."""


def tap_test() -> TapTest:
    """Ten hits with noise on one mode."""
    random, time_ = np.random.default_rng(1), np.arange(SCANS) / RATE
    pulse = np.where(time_ < 7e-4, np.sin(np.pi * time_ / 7e-4) ** 4, 0.0)
    ringing = np.exp(-2 * np.pi * 1722 * 0.029 * time_) * np.sin(2 * np.pi * 1722 * time_)
    hits = []
    for _ in range(HITS):
        values = np.stack([250 * pulse, 900 * ringing]) + random.normal(scale=[[0.1], [2.0]], size=(2, SCANS))
        codes = np.stack([channel.encode(one) for channel, one in zip(CHANNELS, values, strict=True)])
        hits.append(Hit.from_codes(codes, CHANNELS, RATE, 1024))
    about = Circumstances("m", datetime.now(UTC), "reference")
    return TapTest("first", about, estimate_frf(hits), tuple(hits), (HitFlags.OK,) * HITS)


def plain(path: Path, tap: TapTest, **packed: object) -> None:
    """Write the codes and the FRF with plain h5py: no temporary name, no checksum, no sync."""
    codes = np.stack([hit.codes for hit in tap.hits if hit.codes is not None]).astype(np.int16)
    with h5py.File(path, "w") as file:
        file.create_dataset("codes", data=codes, chunks=(1, 2, codes.shape[2]), **packed)
        file["receptance"] = tap.required_frf.receptance


def races() -> Iterator[Race]:
    """Compare with h5py."""
    with TemporaryDirectory() as scratch:
        make_machine_folder(Path(scratch, "m"), "new_machine.toml")
        folder, tap, file, numbers = MachineFolder(Path(scratch, "m")), tap_test(), Path(scratch, "plain.h5"), count()
        yield Race(
            f"tap test stored, {HITS} hits",
            lambda: folder.commit(replace(tap, id=f"tap_{next(numbers)}")),
            "h5py, same data",
            lambda: plain(file, tap, **PACKED),
        )


def cost(work: Callable[[int], object], rounds: int) -> tuple[float, float]:
    """Median CPU and wall time (s); work: called with the number of the round."""
    cpu, wall = [], []
    for number in range(rounds):
        begun, begun_wall = time.process_time(), time.perf_counter()
        work(number)
        cpu.append(time.process_time() - begun)
        wall.append(time.perf_counter() - begun_wall)
    return statistics.median(cpu), statistics.median(wall)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=15)
    rounds = parser.parse_args().rounds
    with threadpool_limits(1), TemporaryDirectory() as scratch:
        make_machine_folder(Path(scratch, "m"), "new_machine.toml")
        folder, tap, file = MachineFolder(Path(scratch, "m")), tap_test(), Path(scratch, "plain.h5")
        folder.commit(tap)
        rows = {
            "h5py, codes and FRF as they are": cost(lambda _: plain(file, tap), rounds),
            "h5py, packed as a tap file is": cost(lambda _: plain(file, tap, **PACKED), rounds),
            "lobewatch commit": cost(lambda n: folder.commit(replace(tap, id=f"tap_{n}")), rounds),
        }
        size = (folder.path / "taps" / "tap_0.h5").stat().st_size
    sys.stdout.write(f"Python {platform.python_version()}, h5py {h5py.__version__}, {os.cpu_count()} cores\n")
    sys.stdout.write(f"{HITS} hits x 2 x {SCANS}, a tap file of {size / 1e6:.1f} MB, {rounds} rounds\n")
    first = rows["h5py, packed as a tap file is"][0]
    for name, (cpu, wall) in rows.items():
        sys.stdout.write(f"  {name:34s} {cpu * 1e3:7.1f} ms CPU {cpu / first:6.2f} x {wall * 1e3:9.1f} ms\n")


if __name__ == "__main__":
    main()
