"""Speed and error of the spindle model compared with finite elements and ROSS, all in one run and one BLAS thread.

    python3 -m pip install --editable ".[bench]"    (for ROSS; without it the rest is measured)
    python3 bench/bench_dsm.py                      (about a minute, most of it ROSS)
    python3 bench/bench_dsm.py --quick              (few repetitions, without ROSS)

Times are medians of the CPU time of repeated runs: other programs on the machine do not change them by much, though
they share its caches. "cold": a spindle that was never seen before, so that its matrix has to be made, with other
bearings than one that was or with another geometry too; "warm": the same one again; the matrices of the others are made
beforehand too. The factors are times over that of the first row. An error is the largest relative difference from the
exact solution, which the model is. The row of LAPACK alone tells what the machine can do: other machines are compared
by the factors to it.
"""

from __future__ import annotations

import argparse
import os
import platform
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import scipy
from dsm_peers import Complex, FiniteElements, Float, RossRotor, import_ross, refine
from race import Race
from scipy.linalg.lapack import dsyevd, dsytrf, dsytrs
from threadpoolctl import threadpool_limits

from dsm import (
    Spindle,
    Theory,
    calibrate,
    change_tool,
    couple_tool,
    natural_frequencies,
    receptance,
    receptance_map,
    spindle_side,
    whirl_map,
)
from lobewatch.machine.settings.machine_file import read_machine_file

MACHINE = Path(__file__).parent.parent / "sim_data" / "surrogate_machine.toml"
MEASURED = 1722.0
"""First natural frequency that is calibrated to (Hz)."""
STIFFNESS = 1.28e9
"""Default stiffness of each bearing (N/m)."""
LOSS_FACTOR = 0.05
MODES = 6
REFINED = 2e-6
"""Relative error in k that the refined elements are allowed."""


@dataclass(frozen=True)
class Bench:
    """Scope of the measurements."""

    repeats: int
    frequencies: int
    factors: int
    speeds: int

    def seconds(self, work: Callable[[], Any], repeats: int | None = None) -> float:
        """Median time of a run."""
        work()
        times = []
        for _ in range(repeats or self.repeats):
            start = time.process_time()
            work()
            times.append(time.process_time() - start)
        return median(times)


class Table:
    """Rows of one question; the first row is what the others are compared with."""

    def __init__(self, title: str) -> None:
        print(f"\n{title}")
        self.first: float | None = None

    def row(self, name: str, seconds: float, error: str = "") -> None:
        """Print one."""
        self.first = self.first or seconds
        digits = f"{1e3 * seconds:.2f}" if seconds < 1 else f"{1e3 * seconds:.0f}"
        print(f"  {name:<52}{digits:>10} ms{seconds / self.first:>10.1f} x   {error}".rstrip())


def spindle(theory: Theory) -> Spindle:
    """The surrogate spindle."""
    drawn = read_machine_file(MACHINE).spindle
    if drawn is None:
        raise SystemExit(f"{MACHINE}: no [spindle]")
    built = drawn.build()
    return replace(built, bearings=[replace(b, stiffness=STIFFNESS) for b in built.bearings], theory=theory)


def never_seen(
    given: Spindle, bench: Bench, change: Callable[[Spindle, float], Spindle] | None = None
) -> Callable[[], Spindle]:
    """Hands out spindles made beforehand that differ in the last digits, in their bearings or as `change` says."""
    factors = 1 + 1e-12 * np.arange(1, bench.repeats + 2)
    spindles = iter([(change or scaled)(given, factor) for factor in factors])
    return lambda: next(spindles)


def stretched(given: Spindle, factor: float) -> Spindle:
    """With longer segments."""
    return replace(given, segments=[replace(part, length=float(factor) * part.length) for part in given.segments])


def least_work(given: Spindle) -> Callable[[], Any]:
    """Factor of a matrix of a node a segment end, one solution a bearing, eigenvalues of the compliance there."""
    size, bearings = 2 * len(given.segments) + 2, len(given.bearings)
    matrix = np.asfortranarray(np.diag(np.full(size, 2.0)) - np.eye(size, k=1) - np.eye(size, k=-1))
    forces = np.asfortranarray(np.eye(size, bearings))

    def work() -> None:
        factor, pivots, _ = dsytrf(matrix, lower=1)
        solved, _ = dsytrs(factor, pivots, forces, lower=1)
        dsyevd(solved[:bearings])

    return work


def scaled(given: Spindle, factor: float) -> Spindle:
    """With other bearings."""
    return replace(given, bearings=[replace(b, stiffness=float(factor) * b.stiffness) for b in given.bearings])


def difference(found: Any, exact: Any) -> str:
    """Largest relative difference."""
    return f"error {np.max(np.abs(np.asarray(found) / np.asarray(exact) - 1)):.1e}"


def nearest(found: Float, wanted: Float) -> Float:
    """Return the found frequency nearest to each wanted one."""
    return np.asarray(found[np.argmin(np.abs(found[:, np.newaxis] - wanted), axis=0)])


def bench_calibration(bench: Bench, given: Spindle) -> None:
    """Bearing stiffness from one frequency."""
    exact = calibrate(given, MEASURED)
    table, fresh = Table(f"Calibration to {MEASURED:g} Hz, {given.theory}"), never_seen(given, bench)
    table.row("this model, warm", bench.seconds(lambda: calibrate(given, MEASURED)), "exact")
    table.row("this model, other bearings, cold", bench.seconds(lambda: calibrate(fresh(), MEASURED)), "exact")
    shapes = never_seen(given, bench, stretched)
    table.row("this model, another geometry, cold", bench.seconds(lambda: calibrate(shapes(), MEASURED)), "exact")
    table.row("this model, warm, and its spindle", bench.seconds(lambda: calibrate(given, MEASURED).spindle), "exact")
    table.row("LAPACK alone: factor, solve, eigenvalues", bench.seconds(least_work(given)))
    print(f"  {'':<52}solved anew, the frequency is off by {abs(exact.residual) / MEASURED:.0e}")
    if given.theory != "euler-bernoulli":
        return
    k = exact.bearing_stiffness
    coarse, (fine, parts) = FiniteElements(given), refine(given, MEASURED, k, REFINED)
    for elements, name in ((coarse, "1 element"), (fine, f"{parts} elements")):
        size = f"{name} a segment, {elements.mass.shape[0]} dof"
        rivals = {"eigh + brentq": elements.calibrate, "1 eigenproblem": elements.calibrate_by_eigenproblem}
        if elements is fine:
            rivals["eigsh + brentq"] = elements.calibrate_sparse
        for how, rival in rivals.items():
            seconds = bench.seconds(lambda rival=rival: rival(MEASURED), max(3, bench.repeats // 10))  # type: ignore[misc]
            table.row(f"{size}, {how}", seconds, difference(rival(MEASURED), k))


def bench_modes(bench: Bench, given: Spindle, ross: RossRotor | None) -> None:
    """The lowest natural frequencies."""
    exact = natural_frequencies(given, MODES)
    table, fresh = Table(f"{MODES} natural frequencies, {given.theory}"), never_seen(given, bench)
    table.row("this model, each certified, warm", bench.seconds(lambda: natural_frequencies(given, MODES)), "exact")
    table.row("this model, each certified, cold", bench.seconds(lambda: natural_frequencies(fresh(), MODES)), "exact")
    if given.theory == "euler-bernoulli":
        elements = FiniteElements(given)
        seconds = bench.seconds(lambda: elements.frequencies(STIFFNESS, MODES))
        table.row("1 element a segment, 54 dof", seconds, difference(elements.frequencies(STIFFNESS, MODES), exact))
    if ross is not None:
        found = nearest(ross.frequencies(), exact)
        table.row("ROSS, 1 element a segment", bench.seconds(ross.frequencies, 3), difference(found, exact))


def bench_receptance(bench: Bench, given: Spindle, ross: RossRotor | None) -> None:
    """Tip receptance over frequency."""
    f = np.linspace(100.0, 4000.0, bench.frequencies)
    exact = receptance(given, f, loss_factor=LOSS_FACTOR)
    table, fresh = Table(f"Tip receptance at {f.size} frequencies, {given.theory}"), never_seen(given, bench)
    cold = bench.seconds(lambda: receptance(fresh(), f, loss_factor=LOSS_FACTOR))
    table.row("this model, warm", bench.seconds(lambda: receptance(given, f, loss_factor=LOSS_FACTOR)), "exact")
    table.row("this model, cold", cold, "exact")
    if given.theory == "euler-bernoulli":
        elements = FiniteElements(given)
        seconds = bench.seconds(lambda: elements.tip_receptance(STIFFNESS, f, LOSS_FACTOR), 3)
        found = elements.tip_receptance(STIFFNESS, f, LOSS_FACTOR)
        table.row("1 element a segment, 54 dof, one solve a frequency", seconds, difference(found, exact))
    if ross is not None:
        start = time.process_time()
        found = ross.tip_receptance(f)
        seconds = time.process_time() - start
        error = f"median error {np.median(np.abs(found / receptance(given, f) - 1)):.1e}"
        table.row("ROSS, 1 element a segment, undamped (1 run)", seconds, error)


def bench_tools(bench: Bench, given: Spindle) -> None:
    """Tip receptance with another tool."""
    f = np.linspace(100.0, 4000.0, bench.frequencies)
    machine = read_machine_file(MACHINE)
    tool, cut = machine.tool[0].build(given), sum(segment.length for segment in given.segments[:4])
    table = Table(f"Tip receptance with another tool at {f.size} frequencies, {given.theory}")
    side, whole = spindle_side(given, f, cut, LOSS_FACTOR), change_tool(given, cut, tool)
    found, exact = couple_tool(side, tool), receptance(whole, f, loss_factor=LOSS_FACTOR)
    table.row(
        "tool coupled to the condensed spindle",
        bench.seconds(lambda: couple_tool(side, tool)),
        difference(found, exact),
    )
    table.row("whole shaft", bench.seconds(lambda: receptance(whole, f, loss_factor=LOSS_FACTOR)), "exact")
    table.row("condensing the spindle, once", bench.seconds(lambda: spindle_side(given, f, cut, LOSS_FACTOR)))


def bench_map(bench: Bench, given: Spindle) -> None:
    """Tip receptance for many bearing stiffnesses."""
    f, factors = np.linspace(100.0, 4000.0, max(2, bench.frequencies // 5)), np.geomspace(0.1, 10.0, bench.factors)
    table = Table(f"Tip receptance, {factors.size} bearing stiffnesses x {f.size} frequencies, {given.theory}")

    def one_by_one() -> Complex:
        spindles = [scaled(given, factor) for factor in factors]
        return np.array([receptance(changed, f, loss_factor=LOSS_FACTOR) for changed in spindles])

    seconds = bench.seconds(lambda: receptance_map(given, f, factors, loss_factor=LOSS_FACTOR), 5)
    start = time.process_time()
    exact = one_by_one()
    rival = time.process_time() - start
    error = difference(receptance_map(given, f, factors, loss_factor=LOSS_FACTOR), exact)
    table.row("one eigenproblem a frequency", seconds, error)
    table.row("receptance of each (1 run)", rival, "exact")


def bench_whirl(bench: Bench, given: Spindle) -> None:
    """Whirl frequencies over speed."""
    speeds = np.linspace(0.0, 20000.0, bench.speeds)
    table = Table(f"Whirl map, {given.theory}: {MODES} forward and backward frequencies at {speeds.size} speeds")
    fresh = never_seen(given, Bench(5, 0, 0, 0))
    table.row("this model, each certified, cold", bench.seconds(lambda: whirl_map(fresh(), speeds, MODES), 5))


def races() -> Iterator[Race]:
    """Compare with finite elements and ROSS."""
    given, f = spindle("euler-bernoulli"), np.linspace(100.0, 4000.0, 1000)
    coarse, (fine, parts) = (
        FiniteElements(given),
        refine(given, MEASURED, calibrate(given, MEASURED).bearing_stiffness, REFINED),
    )
    question, ours = f"bearings calibrated to {MEASURED:g} Hz", partial(calibrate, given, MEASURED)
    for elements, name in ((coarse, "1 finite element"), (fine, f"{parts} finite elements")):
        peer = f"{name} per segment"
        yield Race(question, ours, peer, partial(elements.calibrate, MEASURED))
    factors = np.geomspace(0.1, 10.0, 1000)
    yield Race(
        f"{factors.size * 200} tip receptances",
        lambda: receptance_map(given, f[::5], factors, loss_factor=LOSS_FACTOR),
        "lobewatch, one by one",
        lambda: [receptance(scaled(given, factor), f[::5], loss_factor=LOSS_FACTOR) for factor in factors[::20]],
        part=1 / 20,
    )
    if (package := import_ross()) is None:
        raise ModuleNotFoundError(name="ross")
    ross = RossRotor(package, given)
    yield Race(f"{MODES} natural frequencies", lambda: natural_frequencies(given, MODES), "ROSS", ross.frequencies)
    yield Race(
        f"{f.size} tip receptances",
        lambda: receptance(given, f, loss_factor=LOSS_FACTOR),
        "ROSS",
        lambda: ross.tip_receptance(f[::40]),
        part=1 / 40,
    )


def main() -> None:
    """Print all tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--quick", action="store_true", help="few repetitions, without ROSS")
    quick = parser.parse_args().quick
    bench = Bench(3, 50, 10, 10) if quick else Bench(100, 1000, 1000, 100)
    ross = None if quick else import_ross()
    with threadpool_limits(1):
        cpu = platform.processor() or platform.machine()
        print(f"Python {platform.python_version()}, numpy {np.__version__}, scipy {scipy.__version__}, ", end="")
        print(f"{cpu}, {os.cpu_count()} cores, one BLAS thread")
        missing = "is left out" if quick else 'is not installed: python3 -m pip install --editable ".[bench]"'
        print(f"ROSS {ross.__version__ if ross else missing}")
        for theory in ("euler-bernoulli", "timoshenko"):
            given = spindle(theory)
            rotor = None if ross is None else RossRotor(ross, given)
            bench_calibration(bench, given)
            bench_modes(bench, given, rotor)
            bench_receptance(bench, given, rotor)
            bench_map(bench, given)
            bench_tools(bench, given)
            bench_whirl(bench, given)


if __name__ == "__main__":
    main()
