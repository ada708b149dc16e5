"""Speed and errors of modal extraction compared with sdypy-EMA, in one process with one BLAS thread each.

    python -m pip install -e .[bench]      (in an environment of its own)
    python bench/bench_modal.py [FOLDER | FILES]

One accelerance of 8193 lines (that at 0 Hz is left out) with five modes and noise. Ours: `fit_modes`, which finds,
selects and fits the modes and gives their standard errors. Theirs: get_poles at order 60, select_closest_poles at the
true frequencies, get_constants.

FOLDER holds measured FRFs, as SignalCalc writes them (MAT files with H1_2, H1_3, ... in g/N): some of its files are
timed the same way, theirs told the frequencies that ours found; then five of the FRFs with common poles.

FILES are FRFs of the points of one structure as text (Hz, real and imaginary part in m/N): their fit with common poles
is timed compared with that of sdypy-EMA.
"""

from __future__ import annotations

import contextlib
import io
import sys
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from race import Race, run
from sdypy import EMA
from signalcalc import measured_frfs
from threadpoolctl import threadpool_limits

from acquisition import Frf, estimate_frf, from_accelerance, read_hits
from modal import Mode, fit_common_modes, fit_modes, synthesize_frf

TRUE = [
    Mode(420.0, 0.020, 6.0e7),
    Mode(900.0, 0.010, 4.0e7),
    Mode(1722.0, 0.029136, 3.2289e7),
    Mode(2600.0, 0.015, 9.0e7),
    Mode(3400.0, 0.020, 1.2e8),
]
LINES = np.linspace(0.0, 4096.0, 8193)[1:]
NOISE = 1e-5
"""rms over the largest accelerance."""
ROUNDS = 7
MEASURED_FILES, POINTS = 10, 5
"""Files of a folder that are timed, and FRFs that are fitted with common poles."""
BEAM = Path(__file__).parents[1] / "tests" / "data" / "ladisk_beam" / "acceleration.lvm"
"""A hit on a steel beam, measured at the University of Ljubljana."""
Values = NDArray[np.float64]


def measured(seed: int) -> Frf:
    return noisy(TRUE, seed)


def noisy(modes: Sequence[Mode], seed: int) -> Frf:
    exact = synthesize_frf(modes, LINES).accelerance
    noise = np.random.default_rng(seed).normal(size=(2, LINES.size)) / np.sqrt(2)
    return from_accelerance(LINES, exact + NOISE * np.max(np.abs(exact)) * (noise[0] + 1j * noise[1]))


def ours(frf: Frf) -> Values:
    return np.array([(m.frequency, m.damping_ratio, m.stiffness) for m in fit_modes(frf)])


def theirs(frfs: Sequence[Frf], frequencies: list[float]) -> Values:
    """Return the modes of the first FRF by common poles of all FRFs."""
    (frf, *_) = frfs
    model = EMA.Model(
        np.stack([one.accelerance for one in frfs]),
        frf.frequency,
        lower=0.01 * frf.frequency[-1],
        upper=frf.frequency[-1],
        pol_order_high=60,
        frf_form="accelerance",
    )
    with contextlib.redirect_stderr(io.StringIO()), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model.get_poles(show_progress=False)
        model.select_closest_poles(frequencies)
        model.get_constants()
    w, zeta = 2 * np.pi * np.array(model.nat_freq), np.array(model.nat_xi)
    stiffness = w / (2 * np.abs(model.A[0]) * np.sqrt(1 - zeta**2))
    return np.stack([w / (2 * np.pi), zeta, stiffness], axis=1)


def time_measured(folder: Path) -> None:
    files = sorted(folder.glob("*.mat"))
    frfs = [frf for file in files[:: -(-len(files) // MEASURED_FILES)] for frf in measured_frfs(file)]
    mine, other = [], []
    for frf in frfs:
        start = time.process_time()
        modes = fit_modes(frf)
        mine.append(time.process_time() - start)
        with contextlib.suppress(np.linalg.LinAlgError, ValueError):
            start = time.process_time()
            theirs([frf], [mode.frequency for mode in modes])
            other.append(time.process_time() - start)
    start = time.process_time()
    fit_common_modes(frfs[:POINTS])
    together = time.process_time() - start
    print(f"{len(frfs)} measured FRFs of {frfs[0].frequency.size} lines: CPU time (s), median and largest")
    print(f"{'lobewatch fit_modes':32}{np.median(mine):10.3f}{max(mine):10.3f}")
    print(f"{'sdypy-EMA, order 60':32}{np.median(other):10.3f}{max(other):10.3f}   of the {len(other)} that it can fit")
    print(f"{f'lobewatch fit_points, {POINTS} FRFs':32}{together:10.3f}")


def time_points(files: Sequence[str]) -> None:
    """Time the common poles of text FRFs compared with sdypy-EMA."""
    tables = [np.loadtxt(file) for file in files]
    frfs = [Frf(table[1:, 0], table[1:, 1] + 1j * table[1:, 2]) for table in tables]
    seen = [mode.frequency for mode in fit_common_modes(frfs)]
    size = f"{len(files)} FRFs with common poles, {frfs[0].frequency.size} lines, {len(seen)} modes"
    result = run(Race(size, lambda: fit_common_modes(frfs), "sdypy-EMA", lambda: theirs(frfs, seen)))
    ratio = f"{1 / result.times:.2g} ({1 / result.most:.2g} to {1 / result.least:.2g})"
    print(f"{size}: {result.ours_s:.3f} s CPU, {ratio} times that of {result.peer}")


def five_points() -> list[Frf]:
    """Return FRFs of one structure at five points."""
    frfs = []
    for place in range(POINTS):
        shapes = np.cos(np.arange(1, len(TRUE) + 1) * (0.3 + 0.5 * place))
        answering = [
            replace(mode, stiffness=mode.stiffness / shape) for mode, shape in zip(TRUE, shapes.tolist(), strict=True)
        ]
        frfs.append(noisy(answering, place))
    return frfs


def races() -> Iterator[Race]:
    """Compare with sdypy-EMA."""
    peer, true = "sdypy-EMA", [mode.frequency for mode in TRUE]
    frf, beam, points = measured(0), estimate_frf(read_hits(BEAM)), five_points()
    seen = [mode.frequency for mode in fit_modes(beam)]
    size = f"{LINES.size} lines, {len(TRUE)} modes"
    yield Race(f"FRF, {size}", lambda: ours(frf), peer, lambda: theirs([frf], true))
    yield Race(
        f"measured beam, {beam.frequency.size} lines, {len(seen)} modes",
        lambda: ours(beam),
        peer,
        lambda: theirs([beam], seen),
    )
    yield Race(
        f"{POINTS} FRFs with common poles, {size}", lambda: fit_common_modes(points), peer, lambda: theirs(points, true)
    )


def cpu(extract: Callable[[Frf], Values], frf: Frf) -> tuple[float, Values]:
    start = time.process_time()
    found = extract(frf)
    return time.process_time() - start, found


def main() -> None:
    true = np.array([(m.frequency, m.damping_ratio, m.stiffness) for m in TRUE])
    frequencies = [mode.frequency for mode in TRUE]
    methods = {
        "lobewatch fit_modes": ours,
        f"sdypy-EMA {version('sdypy-EMA')}, order 60": lambda frf: theirs([frf], frequencies),
    }
    times: dict[str, list[float]] = {name: [] for name in methods}
    errors: dict[str, list[Values]] = {name: [] for name in methods}
    for round_ in range(ROUNDS):
        frf = measured(round_)
        for name, extract in methods.items():
            seconds, found = cpu(extract, frf)
            times[name].append(seconds)
            errors[name].append(np.abs(found / true - 1).max(axis=0))
    print(f"{LINES.size} lines, {len(TRUE)} modes, noise {NOISE:g} of the largest accelerance, {ROUNDS} rounds")
    print(f"{'':32}{'CPU (s)':>10}{'f':>10}{'zeta':>10}{'K':>10}   largest relative error, median of the rounds")
    for name in methods:
        f, zeta, k = np.median(errors[name], axis=0)
        print(f"{name:32}{np.median(times[name]):10.3f}{f:10.1e}{zeta:10.1e}{k:10.1e}")
    mine, other = (np.median(times[name]) for name in methods)
    print(f"sdypy-EMA takes {other / mine:.1f} times the CPU time of lobewatch")


if __name__ == "__main__":
    with threadpool_limits(limits=1):
        main()
        if Path(*sys.argv[1:2]).is_dir() and len(sys.argv) > 1:
            time_measured(Path(sys.argv[1]))
        elif len(sys.argv) > 1:
            time_points(sys.argv[1:])
