"""Speed of lobes/ beside the textbook loop and a batched numpy form of it, all in one run on one machine.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 .venv/bin/python bench/bench_lobes.py

The peers are first-order semi-discretisation of one mode in the feed direction. The textbook loop follows the printed
listings: for each interval the matrix exponential (scipy.linalg.expm) wherever the formula has it, three times, then
products of dense (m + 2)-sized matrices and all eigenvalues, point by point. The batched form does all depths of a
speed at once: exponentials in closed form, products of the thin factors only, numpy's eigenvalues of the stack. The
textbook loop runs on every 8th speed and its time is scaled up.
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
STIFFNESS = 0.03993 * (2 * np.pi * FREQUENCY) ** 2
CUT = Cut(2, 1.0, "down", 6e8, 2e8)
THINNED = 8

Floats = NDArray[np.float64]


def textbook(speeds: Floats, depths: Floats) -> Floats:
    """As the listings of Insperger & Stepan: expm wherever it is written, dense products, all eigenvalues."""
    w, mass = 2 * np.pi * FREQUENCY, STIFFNESS / (2 * np.pi * FREQUENCY) ** 2
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
    """All depths of a speed at once: rows of the period map are filled from the rows an interval reads."""
    w, mass = 2 * np.pi * FREQUENCY, STIFFNESS / (2 * np.pi * FREQUENCY) ** 2
    pull = depths[:, np.newaxis] * interval_forces(CUT, M, np.zeros(1))[0, :, 0, 0] / mass
    radius = np.empty((speeds.size, depths.size))
    for i, speed in enumerate(speeds):
        free, begin, end = _batched_steps(pull, w, 60 / (CUT.teeth * speed * M))
        n = depths.size
        old = np.broadcast_to(np.eye(M + 2)[2:][::-1], (n, M, M + 2))
        now = np.broadcast_to(np.eye(M + 2)[:2], (n, 2, M + 2))
        rows = np.empty((n, M, M + 2))
        for k in range(M):
            rows[:, M - 1 - k] = now[:, 0]
            after = old[:, k + 1] if k + 1 < M else rows[:, M - 1]
            now = free[:, k] @ now + begin[:, k, :, np.newaxis] * old[:, k, np.newaxis]
            now = now + end[:, k, :, np.newaxis] * after[:, np.newaxis]
        radius[i] = np.max(np.abs(np.linalg.eigvals(np.concatenate((now, rows), axis=1))), axis=1)
    return radius


def _batched_steps(pull: Floats, w: float, h: float) -> tuple[Floats, Floats, Floats]:
    """Free response (..., 2, 2) of an interval, and its response to w at begin and end, each (..., 2)."""
    stiffness, decay = w**2 + pull, ZETA * w
    root = np.sqrt((stiffness - decay**2).astype(complex))
    fade = np.exp(-decay * h)
    cosine, sine = (np.cos(root * h).real * fade, (np.sin(root * h) / root).real * fade)
    free = np.stack(
        [np.stack([cosine + decay * sine, sine], -1), np.stack([-stiffness * sine, cosine - decay * sine], -1)], -2
    )
    step = (1 - free[..., 0, 0]) / stiffness
    ramp = (h - 2 * decay * step - free[..., 0, 1]) / stiffness
    late, late_speed = ramp / h * pull, step / h * pull
    return free, np.stack([step * pull - late, sine * pull - late_speed], -1), np.stack([late, late_speed], -1)


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
    wide, also = timed(lambda: batched(SPEEDS, DEPTHS), 1)
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
