"""Speed of lobes/ beside the textbook loop and a batched numpy form of it, all in one run on one machine.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 .venv/bin/python bench/bench_lobes.py

The peers are first-order semi-discretisation of one mode in the feed direction. The textbook loop follows the printed
listings: for each interval the matrix exponential (scipy.linalg.expm) wherever the formula has it, three times, then
products of dense (m + 2)-sized matrices and all eigenvalues, point by point. The batched form is numpy alone: a
thousand points at once, exponentials in closed form, the period map applied to vectors instead of built, eigenvalues
of the stack of 10 x 10 matrices that Arnoldi leaves. The textbook loop runs on every 8th speed and its time is scaled
up.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from acquisition import Frf
from lobes import Cut, spectral_radius, stability_boundary, zero_order
from lobes.tooth_force import interval_forces
from modal import Mode

M = 40
SPEEDS, DEPTHS = np.linspace(5000.0, 25000.0, 200), np.linspace(1e-4, 1e-2, 100)
FREQUENCY, ZETA = 922.0, 0.011
OMEGA = 2 * np.pi * FREQUENCY
STIFFNESS = 0.03993 * OMEGA**2
CUT = Cut(2, 1.0, "down", 6e8, 2e8)
THINNED = 8
EFFORTS = ((8, 10), (12, 16), (0, M + 2))
"""Power steps and Arnoldi vectors of the batched form; what an attempt leaves in doubt goes on to the next."""
TOLERANCE = 1e-10
BLOCK = 1000
"""Points at once: their vectors stay in the cache."""
TERMS = 14
"""Terms of the series of cosine and sine, up to 2 rad in an interval."""

Floats = NDArray[np.float64]


def textbook(speeds: Floats, depths: Floats) -> Floats:
    """As the listings of Insperger & Stepan: expm wherever it is written, dense products, all eigenvalues."""
    w, mass = OMEGA, STIFFNESS / OMEGA**2
    forces = interval_forces(CUT, M, np.zeros(1))[0, :, 0, 0]
    radius = np.empty((speeds.size, depths.size))
    for i, speed in enumerate(speeds):
        h = 60 / (CUT.teeth * speed * M)
        for j, depth in enumerate(depths):
            step, period = np.diag(np.ones(M + 1), -1), np.eye(M + 2)
            step[1:3] = 0
            step[2, 0] = 1
            for force in forces:
                pull = depth * force / mass
                A = np.array([[0, 1], [-(w**2) - pull, -2 * ZETA * w]])
                B = np.array([0, pull])
                inverse = np.linalg.inv(A)
                late = inverse @ inverse @ (expm(A * h) - np.eye(2) - A * h) @ B / h
                step[:2, :2] = expm(A * h)
                step[:2, M + 1] = inverse @ (expm(A * h) - np.eye(2)) @ B - late
                step[:2, M] = late
                period = step @ period
            radius[i, j] = np.max(np.abs(np.linalg.eigvals(period)))
    return radius


def batched(speeds: Floats, depths: Floats) -> Floats:
    """Many points at once: power steps, then Arnoldi, with the period map applied and never built."""
    h = np.repeat(60 / (CUT.teeth * speeds * M), depths.size)
    pull = np.tile(depths, speeds.size) * interval_forces(CUT, M, np.zeros(1))[0, :, 0, :1] * OMEGA**2 / STIFFNESS
    radius, doubt = np.empty(h.size), np.full(h.size, np.inf)
    for effort in EFFORTS:
        left = np.flatnonzero(doubt > TOLERANCE)
        if not left.size:
            break
        for rows in np.array_split(left, -(-left.size // BLOCK)):
            radius[rows], doubt[rows] = _largest(_hessenberg(*_steps(h[rows], pull[:, rows]), *effort))
    return radius.reshape(speeds.size, depths.size)


def _steps(h: Floats, pull: Floats) -> tuple[Floats, Floats]:
    """Free response of z = (q, h q') in each interval and its response to w at begin and end, (M, from, to, points)."""
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
    """Fill out (M + 2, points) with the state, M displacements and z, one tooth period after `state`."""
    drive = past[:, 0] * state[:M, np.newaxis]
    drive += past[:, 1] * state[1 : M + 1, np.newaxis]
    z = state[M:]
    for k in range(M):
        out[k] = z[0]
        drive[k] += free[k, 0] * z[0]
        drive[k] += free[k, 1] * z[1]
        z = drive[k]
    out[M:] = z


def _hessenberg(free: Floats, past: Floats, power: int, size: int) -> Floats:
    """Hessenberg matrices of Arnoldi after power steps, shape (points, size + 1, size)."""
    points = free.shape[-1]
    basis, matrices = np.empty((size + 1, M + 2, points)), np.zeros((size + 1, size, points))
    basis[0] = np.random.default_rng(0).normal(size=(M + 2, 1))
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


def timed(work: Callable[[], Floats], repeats: int) -> tuple[float, Floats]:
    best, result = np.inf, np.empty(0)
    for _ in range(repeats):
        begin = time.perf_counter()
        result = work()
        best = min(best, time.perf_counter() - begin)
    return best, result


def main() -> None:
    x = [Mode(FREQUENCY, ZETA, STIFFNESS)]
    four = ([*x, Mode(1400.0, ZETA, STIFFNESS)], [Mode(1100.0, ZETA, STIFFNESS), Mode(1800.0, ZETA, STIFFNESS)])
    begin = time.perf_counter()
    spectral_radius(x, None, CUT, SPEEDS[:2], DEPTHS[:2], M)
    first = time.perf_counter() - begin
    print(f"{os.cpu_count()} cores; first call, kernel compiled or read from the cache: {first:.1f} s")
    book, exact = timed(lambda: textbook(SPEEDS[::THINNED], DEPTHS), 1)
    book *= THINNED
    wide, also = timed(lambda: batched(SPEEDS, DEPTHS), 5)
    ours, radius = timed(lambda: spectral_radius(x, None, CUT, SPEEDS, DEPTHS, M), 9)
    edge, _ = timed(lambda: stability_boundary(x, None, CUT, SPEEDS, float(DEPTHS[-1]), M).depth, 9)
    many, _ = timed(lambda: spectral_radius(*four, CUT, SPEEDS, DEPTHS, M), 5)
    lines = np.linspace(200.0, 1500.0, 2000)
    tips = [Frf(lines, Mode(f, 0.037, 5.6e6).receptance(lines)) for f in (603.0, 666.0)]
    twenty = np.linspace(590.0, 13000.0, 200)
    order, _ = timed(lambda: zero_order(tips[0], tips[1], Cut(3, 0.5, "up", 6e8, 4.2e7), twenty).depth, 20)
    print(f"chart 200 x 100, m = {M}, one mode:")
    print(f"  textbook loop           {book:8.2f} s      1")
    print(f"  batched numpy           {wide:8.2f} s   {book / wide:6.0f} times faster")
    off = [np.max(np.abs(found[::THINNED] - exact)) for found in (radius, also)]
    print(f"  spectral_radius         {ours:8.2f} s   {book / ours:6.0f} times faster")
    print(f"  from the textbook loop: spectral_radius {off[0]:.1e}, batched numpy {off[1]:.1e}")
    print(f"  stability_boundary      {edge:8.2f} s   {ours / edge:6.1f} times faster than the chart")
    print(f"  four modes, x and y     {many:8.2f} s   {many / ours:6.1f} times the time of one mode")
    print(f"zero_order, 2000 lines, 20 lobes, 200 speeds: {order * 1e3:.1f} ms")


if __name__ == "__main__":
    main()
