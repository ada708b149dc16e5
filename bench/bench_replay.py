"""CPU time, wall time and memory of replays and of long archives: python bench/bench_replay.py [--help].

bench_replay.py replay [FILES]      1000 recorded FRFs of 4097 lines as text, replayed with --jobs 1 and 2; beside the
                                    peers where these are installed (python -m pip install -e ".[bench]")
bench_replay.py archive FOLDER [N]  makes a folder of 10 000 small tap tests, 500 at a time
bench_replay.py open FOLDER         what a folder costs when it is opened, added to, checked, shown
bench_replay.py tap                 size and CPU time of one tap test of ten hits of 2 x 16384 samples
bench_replay.py hits                CPU of H1 and verdicts of ten new hits, over that of their bare rffts, and of parts
                                    of a measurement over that of all of it
"""

from __future__ import annotations

import contextlib
import io
import resource
import shutil
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from bench_acquisition import races_of_new_hits
from bench_lobes import textbook
from numpy.typing import NDArray
from race import Race, run
from threadpoolctl import threadpool_limits

from acquisition import (
    Channel,
    Circumstances,
    Description,
    Frf,
    HammeredStructure,
    Hammering,
    Hit,
    SimulatedSource,
    Structure,
    TapDirection,
    TapTest,
    Trigger,
    average_good_hits,
    capture_hits,
    new_tap_id,
    read_tap,
    write_tap,
)
from acquisition.hit_quality.double_hit import find_force_hole
from acquisition.hits.force_window import window_force
from lobewatch import Logbook
from lobewatch.fleet.fleet import Fleet
from lobewatch.machine import TapEntry
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.machine.settings.machine_file import parse_machine_file
from lobewatch.measurement.tap_measurement import fit_tap, measure
from modal import Mode, find_hit_changes, find_unexplained_peaks, synthesize_frf

BEGIN = datetime(2016, 1, 1, tzinfo=UTC)
SHORT = np.linspace(1202.0, 2198.0, 250)
LONG = np.linspace(0.1, 6400.1, 4097)
PEERS = 10
"""Files that the peers are given: each takes them seconds."""
FEW = 24
"""Tap tests of a folder that a long archive is compared with: enough that both directions tell their own scatter."""
ADDED = 7
"""Tap tests that are committed one after the other: the first finds nothing prepared."""
BATCH = 500
"""Tap tests stored and analysed together."""


def frf(number: int, of: int, lines: NDArray[np.float64]) -> Frf:
    """A mode that falls by 4 % over all of them, with noise of 0.1 % of the peak."""
    random = np.random.default_rng(number)
    frequency = 1713.0 * (1 - 0.04 * number / of) * (1 + 1e-3 * random.standard_normal())
    clean = synthesize_frf([Mode(900.0, 0.03, 8e7), Mode(frequency, 0.03, 3.5e7), Mode(3000.0, 0.02, 1e8)], lines)
    noise = random.standard_normal((2, lines.size)) * 1e-3 * np.max(np.abs(clean.receptance))
    return Frf(lines, clean.receptance + noise[0] + 1j * noise[1], np.full(lines.size, 0.999), 10, "accelerance")


def cpu() -> float:
    """Return the CPU time of this process and of its finished children (s)."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


def told(what: str, work: Callable[[], object]) -> None:
    begin, wall = cpu(), time.monotonic()
    work()
    print(f"{what:60} {cpu() - begin:8.3f} s CPU {time.monotonic() - wall:8.3f} s wall", flush=True)


def replay(count: int = 1000) -> None:
    with tempfile.TemporaryDirectory() as work:
        for name, number in (("one", 1), ("all", count)):
            text_files(Path(work) / name, number)
        for name, jobs in (("one", "1"), ("all", "1"), ("all", "2")):
            machine = Path(work) / f"{name} {jobs}"
            make_machine_folder(machine, "surrogate_machine.toml")
            number = 1 if name == "one" else count
            what = f"replay of {number} FRFs of {LONG.size} lines, --jobs {jobs}"
            told(what, partial(_replayed, machine, Path(work) / name, jobs))
        peers(sorted((Path(work) / "all").iterdir())[:PEERS])


def text_files(folder: Path, count: int) -> None:
    folder.mkdir()
    for number in range(count):
        h = frf(number, count, LONG).receptance
        day = BEGIN + timedelta(days=number)
        head = "Freq (Hz),Real (m/N),Imag (m/N)"
        columns = np.column_stack((LONG, h.real, h.imag))
        np.savetxt(folder / f"{day:%Y-%m-%d}.csv", columns, "%.9e", ",", header=head, comments="")


def peers(files: Sequence[Path]) -> None:
    """Run other software on the same files, step by step, without storage, checks or comparison."""
    try:
        import pyFRF
        from sdypy import EMA
    except ImportError:
        print('the peers are not installed: python -m pip install -e ".[bench]"')
        return
    hits = np.random.default_rng(1).standard_normal((2, 10, 2 * (LONG.size - 1)))
    told("numpy.loadtxt, a file", lambda: np.loadtxt(files[0], delimiter=",", skiprows=1))
    told("pyFRF, H1 and coherence of ten hits of 2 x 8192, were they hits", lambda: _averaged(pyFRF, hits))
    told(f"numpy.loadtxt and sdypy-EMA of order 60, {len(files)} files", partial(_modes, EMA, files))
    both = [Mode(900.0, 0.03, 8e7), Mode(1713.0, 0.03, 3.5e7)]
    speeds, depths = np.array([6200.0]), np.linspace(1e-4, 5e-3, 20)
    told("semi-discretisation loop, a program at 20 depths", lambda: textbook(both, both, speeds, depths))


def _averaged(library: Any, hits: NDArray[np.float64]) -> None:
    found = library.FRF(12800, hits[0], hits[1], exc_type="f", resp_type="a", frf_estimator="H1")
    found.get_H1(), found.get_coherence()


def _modes(library: Any, files: Sequence[Path]) -> None:
    for file in files:
        f, real, imag = np.loadtxt(file, delimiter=",", skiprows=1).T
        with contextlib.redirect_stderr(io.StringIO()), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            receptance = (real + 1j * imag)[None]
            model = library.Model(receptance, f, lower=50, upper=6000, pol_order_high=60, frf_form="receptance")
            model.get_poles(show_progress=False)
            model.select_closest_poles([900.0, 1713.0, 3000.0])
            model.get_constants()


def _words(machine: Path, files: Path, jobs: str) -> list[str]:
    return ["replay", str(machine), str(files), "--date-pattern", "%Y-%m-%d", "--jobs", jobs]


def _replayed(machine: Path, files: Path, jobs: str) -> None:
    code = (
        "import resource, sys; from lobewatch.cli import main\n"
        "try: main()\nfinally: print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024, 'MB', file=sys.stderr)"
    )
    subprocess.run([sys.executable, "-c", code, *_words(machine, files, jobs)], check=True, stdout=subprocess.DEVNULL)


def archive(path: Path, count: int = 10_000) -> None:
    """Tap files and journal lines as a replay commits them, 500 at a time, each followed by its analysis."""
    make_machine_folder(path, "surrogate_machine.toml")
    folder = MachineFolder(path)
    toml = folder.toml.read_text("utf-8")
    (path / "taps").mkdir(exist_ok=True)
    for first in range(0, count, BATCH):
        begin = time.process_time()
        with folder.locked():
            folder.commit_files(dict(_written(path, small_tap(n, count, toml)) for n in range(first, first + BATCH)))
        middle = time.process_time()
        _ = Logbook(MachineFolder(path)).history
        each = [1e3 * (end - start) / BATCH for start, end in pairwise((begin, middle, time.process_time()))]
        print(f"{first + BATCH:6} taps: file and line {each[0]:.1f} ms, analysis {each[1]:.1f} ms a tap", flush=True)


def _written(path: Path, tap: TapTest) -> tuple[Path, TapEntry]:
    temporary = path / "taps" / f".{tap.id}.tmp"
    return temporary, TapEntry.of(tap, write_tap(temporary, tap))


def small_tap(number: int, of: int, toml: str) -> TapTest:
    direction: TapDirection = "y" if number % 2 else "x"
    time_of_it = BEGIN + timedelta(hours=8 * number)
    about = Circumstances("m", time_of_it, "reference", direction, machine_toml=toml)
    return TapTest(new_tap_id(about), about, frf(number, of, SHORT))


def opened(path: Path) -> None:
    """Works on a copy where something is added."""
    _ = Logbook(MachineFolder(path)).history  # brought up to date
    told("opening without new tap tests", lambda: Logbook(MachineFolder(path)).history)
    told("opening and standing", lambda: Logbook(MachineFolder(path)).status())
    plant = Fleet({"m": path})
    told("dashboard, first look", plant.assess_machines)
    told("dashboard, nothing has changed", plant.assess_machines)
    with tempfile.TemporaryDirectory(dir=path.parent) as work:
        few = newest_of(path, Path(work) / "few")
        for command in ("check", "lobes", "history"):
            for folder, of in ((path, "all"), (few, f"the newest {FEW}")):
                words = [sys.executable, "-m", "lobewatch.cli", command, str(folder)]
                told(f"{command} of {of}", partial(subprocess.run, words, check=False, stdout=subprocess.DEVNULL))
        copy = Path(work) / "m"
        shutil.copytree(path, copy)
        for folder in (few, copy):
            added_to(folder)


def added_to(path: Path) -> None:
    """Tap tests committed one after the other, without words on programs."""
    toml = path / "machine.toml"
    toml.write_text(toml.read_text("utf-8").split("[[program]]")[0], "utf-8")
    logbook, plant = Logbook(MachineFolder(path)), Fleet({"m": path})
    _ = logbook.history, plant.assess_machines()
    size, count = logbook.folder.history_path.stat().st_size, len(logbook.taps)
    for number in range(count, count + ADDED):
        tap = small_tap(10_000 + number, 10_000, "")
        told(f"a commit into {number}, journal and tap file", partial(logbook.commit, tap))
        told("its row", lambda: logbook.history)
        told("dashboard after it in a running server", plant.assess_machines)
    print(f"bytes added to history.rows: {(logbook.folder.history_path.stat().st_size - size) / ADDED:.0f}")


def newest_of(path: Path, to: Path) -> Path:
    """A machine folder with the newest tap tests of another: the same spindle, and so the same work."""
    make_machine_folder(to, "surrogate_machine.toml")
    (to / "taps").mkdir(exist_ok=True)
    files = {}
    for entry in MachineFolder(path).taps()[-FEW:]:
        temporary = to / "taps" / f".{entry.id}.tmp"
        shutil.copyfile(path / entry.file, temporary)
        files[temporary] = entry
    folder = MachineFolder(to)
    with folder.locked():
        folder.commit_files(files)
    _ = Logbook(MachineFolder(to)).history
    return to


def races() -> Iterator[Race]:
    """Compare with sdypy-EMA."""
    from sdypy import EMA

    with tempfile.TemporaryDirectory() as work:
        text_files(Path(work) / "files", PEERS)
        files = sorted((Path(work) / "files").iterdir())

        def ours() -> None:
            machine = Path(tempfile.mkdtemp(dir=work)) / "m"
            make_machine_folder(machine, "surrogate_machine.toml")
            command = [sys.executable, "-m", "lobewatch.cli", *_words(machine, Path(work) / "files", "1")]
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)

        yield Race(
            f"`lobewatch replay`, {PEERS} FRFs, {LONG.size} lines",
            ours,
            "loadtxt and sdypy-EMA",
            lambda: _modes(EMA, files),
            rounds=3,
        )


def hammered_hits() -> tuple[Hit, ...]:
    """Ten hits of 2 x 16384 on three modes."""
    structure = Structure(
        np.array([1000.0, 1713.0, 2900.0]), np.array([0.02, 0.03, 0.025]), np.array([2e7, 3.5e7, 9e7]), 2e-9
    )
    hammered = HammeredStructure(
        structure, 51200.0, np.random.default_rng(1), Hammering(double_hits=0.0, overloads=0.0)
    )
    channels = Channel("force", 2.25e-3, 5.0), Channel("acceleration", 1.02e-3, 5.0)
    found = capture_hits(SimulatedSource(hammered, channels, 51200.0, 3_000_000), Trigger(20.0, 16384, 512))
    return tuple(hit for hit, _ in zip(found, range(10), strict=False))


def ten_hits() -> None:
    hits = hammered_hits()
    average, flags = average_good_hits(hits)
    about = Circumstances("m", BEGIN, "reference")
    tap, machine = (
        TapTest(new_tap_id(about), about, average, hits, flags),
        parse_machine_file('[machine]\nname = "m"\n'),
    )
    with tempfile.TemporaryDirectory() as work:
        path = Path(work) / "tap.h5"
        print(f"{len(hits)} hits of 2 x 16384: {len(write_tap(path, tap)) / 1e3:.0f} kB")
        for _ in range(3):
            told("read and fitted", lambda: fit_tap(read_tap(path), machine))
        other = Path(work) / "m"
        make_machine_folder(other, "surrogate_machine.toml")
        replayed = Logbook(MachineFolder(other)).replay_all([path], Description()).tap_ids[0]
        print(f"replayed from that file: {(other / 'taps' / f'{replayed}.h5').stat().st_size / 1e3:.0f} kB")


def new_hits() -> None:
    """State CPU ratios to the peer, both measured in turns."""
    with threadpool_limits(1):
        for race in (*races_of_new_hits(), *races_of_parts()):
            result = run(race)
            span = f"({1 / result.most:.2g} to {1 / result.least:.2g})"
            print(f"{race.question}: {1 / result.times:.2g} {span} times the CPU of {race.peer}", flush=True)


def races_of_parts() -> Iterator[Race]:
    """Compare parts of a measurement with all of it, and the search for a hole in the force with a transform."""
    machine, about = parse_machine_file('[machine]\nname = "m"\n'), Circumstances("m", BEGIN, "reference")
    tap, hits = TapTest(new_tap_id(about), about, frf(3, 10, LONG)), hammered_hits()
    mean, flags = average_good_hits(hits)
    found = measure(tap, machine)

    def renew() -> tuple[Hit, ...]:
        return tuple(replace(hit) for hit in hits)

    yield Race(
        "search for unexplained peaks",
        lambda: find_unexplained_peaks(found.frf, found.used) if found.frf else (),
        f"the measurement of an FRF, {LONG.size} lines",
        lambda: measure(tap, machine),
    )
    yield Race(
        "changes over hits",
        lambda: find_hit_changes(renew()),
        "the measurement of ten new hits of 16384 samples",
        lambda: measure(replace(tap, frf=mean, hits=renew(), flags=flags), machine),
    )
    part = window_force(replace(hits[0], force=hits[0].force + 0.95 * np.roll(hits[0].force, 9000)))
    yield Race(
        "hole of two nearly equal touches, 9000 samples apart",
        lambda: find_force_hole(part, 51200.0, np.inf),
        "the rfft of 16384 samples",
        lambda: np.fft.rfft(hits[0].force),
    )


def main() -> None:
    what, *rest = sys.argv[1:] or ["--help"]
    if what == "replay":
        replay(*map(int, rest))
    elif what == "archive":
        archive(Path(rest[0]), *map(int, rest[1:]))
    elif what == "open":
        opened(Path(rest[0]))
    elif what == "tap":
        ten_hits()
    elif what == "hits":
        new_hits()
    else:
        print(__doc__)


if __name__ == "__main__":
    main()
