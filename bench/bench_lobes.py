"""CPU time of lobes/ compared with two peers, with the error of each, in one run on one machine and one BLAS thread.

    .venv/bin/python bench/bench_lobes.py

The peers are first-order semi-discretisation. The textbook loop follows the printed listings, for any modes: for each
interval the matrix exponential (scipy.linalg.expm) wherever the formula has it, three times, then products of dense
matrices and all eigenvalues, point by point. The batched form is numpy alone, for one mode in x: a thousand points at
once, exponentials in closed form, the period map applied to vectors instead of built, eigenvalues of the stack of
10 x 10 matrices that Arnoldi leaves.

Times are taken in turns, the best of ten each, of the whole chart by lobes/ and of a part of it by the peers, whose
time goes with the points. Errors are relative, the largest of some speeds and all depths, against `lobes.floquet` with
eight times the pieces that it takes by itself; the batched form, which shares no code with it, comes to the same with
ever more intervals.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from race import Race
from scipy.linalg import expm
from threadpoolctl import threadpool_limits

from acquisition import Frf
from lobes import Cut, spectral_radius, stability_boundary, zero_order_lobes
from lobes.floquet import count_pieces, largest_multipliers, rows_at_speeds
from lobes.milling_system import build_milling_system
from lobes.tooth_force import interval_forces
from modal import Mode

M = 40
FINE = 640
SPEEDS, DEPTHS = np.linspace(5000.0, 25000.0, 200), np.linspace(1e-4, 1e-2, 100)
FREQUENCY, ZETA = 922.0, 0.011
OMEGA = 2 * np.pi * FREQUENCY
STIFFNESS = 0.03993 * OMEGA**2
CUT = Cut(2, 1.0, "down", 6e8, 2e8)
X = [Mode(FREQUENCY, ZETA, STIFFNESS)]
FOUR = ([*X, Mode(1400.0, ZETA, STIFFNESS)], [Mode(1100.0, ZETA, STIFFNESS), Mode(1800.0, ZETA, STIFFNESS)])
THINNED = 8
"""Errors of one mode are looked at on every 8th speed ..."""
SPARSE = 40
"""... of four modes on every 40th."""
ROUNDS = 10
NEAR = 0.2
EFFORTS = ((8, 10), (12, 16), (0, M + 2))
"""Power steps and Arnoldi vectors of the batched form; what an attempt leaves in doubt goes on to the next."""
TOLERANCE = 1e-10
BLOCK = 1000
"""Points at once: their vectors stay in the cache."""
TERMS = 14
"""Terms of the series of cosine and sine, up to 2 rad in an interval."""

Floats = NDArray[np.float64]
Modes = Sequence[Mode] | None


def textbook(x: Modes, y: Modes, speeds: Floats, depths: Floats, exponentials: int = 3) -> Floats:
    """Compute multipliers as Insperger & Stepan's listings: dense products, all eigenvalues, expm each time or once."""
    system = build_milling_system(x, y)
    n, p = system.frequency.size, system.axes.size
    shape = (system.shape[:, np.newaxis] * system.vector).T
    forces = interval_forces(CUT, M)[0][:, system.axes[:, np.newaxis], system.axes]
    one, A, B = np.eye(2 * n), np.diag(np.ones(n), n), np.zeros((2 * n, p))
    A[n:, n:] = -2 * np.diag(system.damping_ratio * system.frequency)
    stiff = np.diag(system.frequency**2)
    radius = np.empty((speeds.size, depths.size))
    for i, speed in enumerate(speeds):
        h = 60 / (CUT.teeth * speed * M)
        for j, depth in enumerate(depths):
            step, period = np.diag(np.ones(2 * n + (M - 1) * p), -p), np.eye(2 * n + M * p)
            step[: 2 * n + p] = 0
            step[2 * n : 2 * n + p, :n] = shape
            for force in forces:
                B[n:] = depth * shape.T @ force
                A[n:, :n] = -stiff - B[n:] @ shape
                inverse, exponential = np.linalg.inv(A), [expm(A * h) for _ in range(exponentials)]
                late = inverse @ inverse @ (exponential[0] - one - A * h) @ B / h
                step[: 2 * n, : 2 * n] = exponential[-1]
                step[: 2 * n, -p:] = inverse @ (exponential[exponentials // 2] - one) @ B - late
                step[: 2 * n, -2 * p : -p] = late
                period = step @ period
            radius[i, j] = np.max(np.abs(np.linalg.eigvals(period)))
    return radius


def batched(speeds: Floats, depths: Floats, m: int) -> Floats:
    """Many points at once: power steps, then Arnoldi, with the period map applied and never built."""
    h = np.repeat(60 / (CUT.teeth * speeds * m), depths.size)
    pull = np.tile(depths, speeds.size) * interval_forces(CUT, m)[0, :, 0, :1] * OMEGA**2 / STIFFNESS
    radius, doubt = np.empty(h.size), np.full(h.size, np.inf)
    for effort in EFFORTS:
        left = np.flatnonzero(doubt > TOLERANCE)
        if not left.size:
            break
        for rows in np.array_split(left, -(-left.size // BLOCK)):
            radius[rows], doubt[rows] = _largest(_hessenberg(*_steps(h[rows], pull[:, rows]), *effort))
    return radius.reshape(speeds.size, depths.size)


def _steps(h: Floats, pull: Floats) -> tuple[Floats, Floats]:
    """Free response of z = (q, h q') in each interval and its response to w at begin and end, (m, from, to, points)."""
    stiffness, decay = OMEGA**2 + pull, ZETA * OMEGA
    x, cosine, sine = (decay**2 - stiffness) * h**2, np.ones_like(pull), np.ones_like(pull)
    for k in range(TERMS, 0, -1):
        cosine = 1 + cosine * x / (2 * k * (2 * k - 1))
        sine = 1 + sine * x / (2 * k * (2 * k + 1))
    cosine, sine = cosine * np.exp(-decay * h), sine * h * np.exp(-decay * h)
    begin = cosine + decay * sine
    step = (1 - begin) / stiffness
    late, late_speed = (h - 2 * decay * step - sine) / stiffness / h * pull, step * pull
    free = np.array([[begin, -stiffness * sine * h], [sine / h, cosine - decay * sine]])
    past = np.array([[step * pull - late, sine * pull * h - late_speed], [late, late_speed]])
    return np.ascontiguousarray(np.moveaxis(free, 2, 0)), np.ascontiguousarray(np.moveaxis(past, 2, 0))


def _over_period(free: Floats, past: Floats, state: Floats, out: Floats) -> None:
    """Fill out (m + 2, points) with the state, m displacements and z, one tooth period after `state`."""
    m = len(free)
    drive = past[:, 0] * state[:m, np.newaxis]
    drive += past[:, 1] * state[1 : m + 1, np.newaxis]
    z = state[m:]
    for k in range(m):
        out[k] = z[0]
        drive[k] += free[k, 0] * z[0]
        drive[k] += free[k, 1] * z[1]
        z = drive[k]
    out[m:] = z


def _hessenberg(free: Floats, past: Floats, power: int, size: int) -> Floats:
    """Hessenberg matrices of Arnoldi after power steps, shape (points, size + 1, size)."""
    points, states = free.shape[-1], len(free) + 2
    basis, matrices = np.empty((size + 1, states, points)), np.zeros((size + 1, size, points))
    basis[0] = np.random.default_rng(0).normal(size=(states, 1))
    for _ in range(power):
        _over_period(free, past, basis[0] / _length(basis[0]), basis[1])
        basis[0] = basis[1]
    basis[0] /= _length(basis[0])
    for k in range(size):
        new = basis[k + 1]
        _over_period(free, past, basis[k], new)
        for j in (*range(k + 1), *range(k + 1)):
            overlap = np.einsum("ij,ij->j", basis[j], new)
            matrices[j, k] += overlap
            new -= overlap * basis[j]
        matrices[k + 1, k] = _length(new)
        new /= matrices[k + 1, k]
    return np.moveaxis(matrices, -1, 0)


def _length(vectors: Floats) -> Floats:
    return np.asarray(np.sqrt(np.einsum("ij,ij->j", vectors, vectors)))


def _largest(matrices: Floats) -> tuple[Floats, Floats]:
    """Magnitude of the largest Ritz value of each matrix and its residual relative to it."""
    square = np.ascontiguousarray(matrices[:, :-1])
    values = np.linalg.eigvals(square)
    value = np.take_along_axis(values, np.argmax(np.abs(values), axis=1)[:, np.newaxis], axis=1)[:, 0]
    vector = np.ones(values.shape, dtype=np.complex128)
    for j in range(values.shape[1] - 1, 0, -1):
        row = np.einsum("nc,nc->n", square[:, j, j:], vector[:, j:]) - value * vector[:, j]
        vector[:, j - 1] = -row / square[:, j, j - 1]
    residual = matrices[:, -1, -1] * np.abs(vector[:, -1]) / np.linalg.norm(vector, axis=1)
    return np.abs(value), residual / np.abs(value)


def finest(x: Modes, y: Modes, speeds: Floats, depths: Floats) -> Floats:
    rows = rows_at_speeds(build_milling_system(x, y), CUT, speeds)
    grid = np.broadcast_to(depths, (speeds.size, depths.size))
    return np.abs(largest_multipliers(rows, grid, 8 * count_pieces(rows, float(np.max(depths)))))


class Chart(NamedTuple):
    name: str
    work: Callable[[Floats, Floats], Floats]
    speeds: Floats
    """Speeds for the measurement of the time."""
    depths: Floats
    checked: Floats
    """Speeds for the error, all of `exact`."""


def cpu_time(work: Callable[..., object], *given: object) -> float:
    """CPU time of all threads (s)."""
    begin = time.process_time()
    work(*given)
    return time.process_time() - begin


def race(charts: Sequence[Chart], exact: Floats) -> None:
    """Time in turns, the best of each; the last chart is that of lobes/."""
    best = np.full(len(charts), np.inf)
    for _ in range(ROUNDS):
        took = [cpu_time(chart.work, chart.speeds, chart.depths) for chart in charts]
        best = np.minimum(best, [t / (c.speeds.size * c.depths.size) for t, c in zip(took, charts, strict=True)])
    near = np.abs(exact - 1) < NEAR
    for chart, seconds in zip(charts, best, strict=True):
        error = np.abs(chart.work(chart.checked, DEPTHS) / exact - 1)
        worst = np.unravel_index(np.argmax(error), error.shape)
        print(
            f"  {chart.name:<46}{seconds * 1e6:7.0f} us a point{seconds / best[-1]:8.1f}   largest error "
            f"{error[worst]:.1e} (of {exact[worst]:.2g}), {np.max(error[near]):.1e} within {NEAR:g} of 1"
        )


def boundary(x: Modes, y: Modes) -> None:
    best = min(cpu_time(stability_boundary, x, y, CUT, SPEEDS, float(DEPTHS[-1])) for _ in range(ROUNDS))
    print(f"  stability_boundary up to the same depth: {best:.2f} s, {best / SPEEDS.size * 1e3:.1f} ms a speed")


def one_mode() -> None:
    few, some = SPEEDS[::THINNED], (SPEEDS[::SPARSE], DEPTHS[::20])
    exact = finest(X, None, few, DEPTHS)
    print(f"chart {SPEEDS.size} x {DEPTHS.size}, one mode, multipliers up to {np.max(exact):.2g}:")
    charts = [
        Chart(f"textbook loop, m = {M}", lambda s, d: textbook(X, None, s, d), *some, few),
        Chart(f"textbook loop, m = {M}, one expm an interval", lambda s, d: textbook(X, None, s, d, 1), *some, few),
        Chart(f"batched numpy, m = {M}", lambda s, d: batched(s, d, M), SPEEDS[::20], DEPTHS, few),
        Chart(f"batched numpy, m = {FINE}", lambda s, d: batched(s, d, FINE), SPEEDS[::20], DEPTHS, few),
        Chart("spectral_radius", lambda s, d: spectral_radius(X, None, CUT, s, d), SPEEDS, DEPTHS, few),
    ]
    race(charts, exact)
    boundary(X, None)


def four_modes() -> None:
    few = SPEEDS[::SPARSE]
    exact = finest(*FOUR, few, DEPTHS)
    print(f"chart {SPEEDS.size} x {DEPTHS.size}, two modes each in x and y, multipliers up to {np.max(exact):.2g}:")
    charts = [
        Chart(f"textbook loop, m = {M}", lambda s, d: textbook(*FOUR, s, d), few, DEPTHS[::20], few),
        Chart("spectral_radius", lambda s, d: spectral_radius(*FOUR, CUT, s, d), SPEEDS, DEPTHS, few),
    ]
    race(charts, exact)
    boundary(*FOUR)


def mean_force() -> None:
    lines, speeds, cut = (
        np.linspace(200.0, 1500.0, 2000),
        np.linspace(590.0, 13000.0, 200),
        Cut(3, 0.5, "up", 6e8, 4.2e7),
    )
    modes = [[Mode(frequency, 0.037, 5.6e6)] for frequency in (603.0, 666.0)]
    tips = [Frf(lines, mode.receptance(lines)) for (mode,) in modes]
    for name, (x, y) in (("FRFs of 2000 lines", tips), ("modes", modes)):
        best = min(cpu_time(zero_order_lobes, x, y, cut, speeds) for _ in range(20 * ROUNDS))
        print(f"zero_order, {name} in x and y, 20 lobes, {speeds.size} speeds: {best * 1e3:.1f} ms")


def races() -> Iterator[Race]:
    """Compare with first-order semi-discretization."""
    some = SPEEDS[::SPARSE], DEPTHS[::20]
    part = some[0].size * some[1].size / (SPEEDS.size * DEPTHS.size)
    for x, y, name in ((X, None, "one mode"), (*FOUR, "four modes")):
        question = f"chart, {SPEEDS.size * DEPTHS.size} points, {name}"
        ours = partial(spectral_radius, x, y, CUT, SPEEDS, DEPTHS)
        for count, text in ((3, "three expm"), (1, "one expm")):
            peer = f"textbook loop, {text} per interval"
            yield Race(question, ours, peer, partial(textbook, x, y, *some, count), part=part)
    peer = "vectorised numpy"
    yield Race(
        f"chart, {SPEEDS.size * DEPTHS.size} points, one mode",
        partial(spectral_radius, X, None, CUT, SPEEDS, DEPTHS),
        peer,
        partial(batched, SPEEDS[::20], DEPTHS, M),
        part=1 / 20,
    )


def main() -> None:
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}, numpy {np.__version__}; CPU time, one BLAS thread")
    with threadpool_limits(1):
        one_mode()
        four_modes()
        mean_force()


if __name__ == "__main__":
    main()
