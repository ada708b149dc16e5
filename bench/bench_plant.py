"""Measure a fleet: the status of many machines, fresh and computed again, and their export.

    python bench/bench_plant.py [--machines 100] [--taps 720] [--keep FOLDER]

CPU time of whole processes, start included. Each machine has its own scatter; the tap files, which no plant view opens
but for the proof of the newest, are links to those of the first. Costs grow with the number of machines: what stands
below for 500 is counted up from the number that was measured, and said to be.
"""

from __future__ import annotations

import argparse
import os
import platform
import resource
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec
import numpy as np
from threadpoolctl import threadpool_limits

from acquisition import Circumstances, TapTest, from_accelerance, new_tap_id, write_tap
from lobewatch.fleet import summarize_folder
from lobewatch.history import History
from lobewatch.history.history_cache import HistoryCache
from lobewatch.logbook import Logbook
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.machine.journal.tap_entry import TapEntry
from lobewatch.measurement import Estimate
from lobewatch.screen.dashboard_table import MACHINE_POLL_INTERVAL, DashboardTable
from lobewatch.tool.tap_series import TapPlace
from modal import Mode, synthesize_frf

LINES = np.arange(8.0, 4000.0, 8.0)
PLANT = 500
"""Machines that are counted up to."""


def make_plant(path: Path, machines: int, taps: int) -> None:
    """Machines of so many tap tests each, x and y in turn, the newest of today; their histories as if worked out."""
    first = path / "mill-000"
    make_machine(first, taps)
    summarize_folder(first, datetime.now(UTC))  # so that its history has the word on each program
    history = Logbook.open(first).history
    for number in range(machines):
        folder = path / f"mill-{number:03d}"
        if number:
            shutil.copytree(first, folder, copy_function=_link)
            for derived in ("history.rows", "standing.json"):
                (folder / derived).unlink()
        HistoryCache(MachineFolder(folder)).store(_scattered(history, Logbook.open(folder).files.places, number))


def _scattered(history: History, places: Sequence[TapPlace], seed: int) -> History:
    """Rows like those of the first two tap tests, with 0.3 % of scatter and a fall of its own."""
    random, rows = np.random.default_rng(seed), history.rows
    falls = np.linspace(0.0, random.uniform(0.0, 3.0), len(places))
    shares = np.exp((random.normal(scale=0.3, size=len(places)) - falls) / 100).tolist()
    found = []
    for place, share in zip(places, shares, strict=True):
        row, time = rows[place.number % 2], datetime.fromisoformat(place.entry.time)
        frequency = Estimate(row.frequency.value * share, 0.2)
        rulings = rows[-1].verdicts if place is places[-1] else None
        found.append(
            replace(row, tap_id=place.entry.id, time=time, series=place.series, frequency=frequency, verdicts=rulings)
        )
    return replace(history, rows=tuple(found))


def _link(source: str, target: str) -> str:
    """Tap files are never rewritten: a link is as good as a copy."""
    if source.endswith(".h5"):
        os.link(source, target)
        return target
    return shutil.copy2(source, target)


def make_machine(path: Path, taps: int) -> None:
    make_machine_folder(path, "surrogate_machine.toml")
    folder, text = MachineFolder(path), (path / "machine.toml").read_text("utf-8")
    (path / "taps").mkdir()
    modes = [Mode(1713.0, 0.029, 3.5e7), Mode(2900.0, 0.02, 9e7), Mode(3400.0, 0.02, 1.2e8)]
    frf, entries = from_accelerance(LINES, synthesize_frf(modes, LINES).accelerance), {}
    for number in range(taps):
        when = datetime.now(UTC) - timedelta(days=0.1 + 5.0 * (taps - 1 - number))
        about = Circumstances("mill", when, "reference", "y" if number % 2 else "x", "", text)
        tap = TapTest(new_tap_id(about), about, frf)
        temporary = path / f"{tap.id}.tmp"
        entries[temporary] = TapEntry.of(tap, write_tap(temporary, tap))
    folder.commit_files(entries)


def cpu_of(*arguments: object) -> float:
    """CPU time of one command (s)."""
    program = [sys.executable, "-m", "lobewatch.cli", *map(str, arguments)]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(program, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def told(name: str, machines: int, work: Callable[[Path], float], plant: Path, rounds: int) -> None:
    """Return one line: all machines, one machine, the whole fleet; minimum of several rounds."""
    everything, one = (min(work(path) for _ in range(rounds)) for path in (plant, plant / "mill-000"))
    whole = one + (everything - one) / (machines - 1) * (PLANT - 1)
    print(f"  {name:30s} {machines} machines {everything:6.2f} s, one {one:5.2f} s, so {PLANT} machines {whole:6.2f} s")


def made_anew(path: Path) -> float:
    for standing in path.rglob("standing.json"):
        standing.unlink()
    return cpu_of("status", path)


def exported(table: Path, path: Path) -> float:
    return cpu_of("export", path, table)


def served(path: Path) -> None:
    """Measure the pages of `lobewatch serve`: first load, without changes, and with one changed machine."""
    board = DashboardTable(path)
    known = ""
    for name in ("first page", "nothing changed", "a machine changed"):
        if name == "a machine changed":
            toml = path / "mill-000" / "machine.toml"
            toml.write_text(toml.read_text("utf-8").replace('name = "', 'name = "New ', 1), "utf-8")
            board.assess_machines()  # its standing made anew is no part of the look
        time.sleep(MACHINE_POLL_INTERVAL)
        begun = time.process_time()
        answer = board.updates_since(known, set())
        sent = msgspec.json.encode(answer)
        print(f"  serve, {name:22s} {time.process_time() - begun:6.2f} s, {len(sent) / 1e3:.1f} kB")
        known = answer["version"]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--machines", type=int, default=100)
    parser.add_argument("--taps", type=int, default=720)
    parser.add_argument("--keep", type=Path)
    wanted = parser.parse_args()
    with threadpool_limits(1), TemporaryDirectory() as scratch:
        plant, n = wanted.keep or Path(scratch, "plant"), wanted.machines
        if not plant.exists():
            make_plant(plant, n, wanted.taps)
        print(f"Python {platform.python_version()}, {os.cpu_count()} cores, {n} machines x {wanted.taps}")
        told("status, standings made anew", n, made_anew, plant, 1)
        cpu_of("status", plant)
        told("status, standings fresh", n, partial(cpu_of, "status"), plant, 3)
        served(plant)
        months = Path(scratch, "months")
        for name in ("all new", "nothing new"):
            print(f"  export --append, {name}: {cpu_of('export', plant, '--append', months):.2f} s")
        for kind in ("sqlite", "csv", "parquet"):
            table = Path(scratch, f"fleet.{kind}")
            told(f"export to {kind}", n, partial(exported, table), plant, 3)
            cpu_of("export", plant, table)
            size = table.stat().st_size / n
            print(f"    {size / wanted.taps:.0f} bytes a tap test, of {PLANT} machines {size * PLANT / 1e6:.0f} MB")
        begun = time.process_time()
        sum(range(10_000_000))
        print(f"  for comparison: ten million additions in Python {time.process_time() - begun:.2f} s")


if __name__ == "__main__":
    main()
