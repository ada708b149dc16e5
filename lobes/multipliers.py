"""The largest Floquet multiplier of milling, by first-order semi-discretisation."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lobes.cut import Cut
from lobes.milling_system import MillingSystem
from lobes.tooth_force import interval_forces

EFFORTS = ((6, 9), (12, 14), (20, 24), (40, 40), (80, 80), (80, 600))
"""Power steps and Arnoldi vectors of each attempt; what an attempt leaves in doubt goes on to the next."""
TOLERANCE = 3e-10
"""Largest residual of a multiplier that counts as found, relative to it, unless another is asked for."""
HUGE = 1e6
"""Of larger multipliers only the order of magnitude is found."""
SMALL = 200
"""Cases that are not worth a second thread."""
MEMORY = 2_000_000
"""Numbers in the Hessenberg matrices of the cases that are solved at once."""

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
_log = logging.getLogger(__name__)


def largest_multipliers(
    system: MillingSystem,
    cut: Cut,
    speed_rpm: Floats,
    depth: Floats,
    intervals: NDArray[np.int64],
    tolerance: float = TOLERANCE,
) -> Complexes:
    """Multiplier of largest magnitude over one tooth period, shape (s, d).

    speed_rpm (s,), depth (s, d) in m, intervals (s,) of the tooth period at each speed. Within each interval the
    cutting coefficients are averaged and the displacement of the period before is linear. The period map is applied,
    never built: power steps, then Arnoldi, until the residual is below `tolerance` times the multiplier. Raises
    ArithmeticError for a multiplier that stays in doubt.
    Source: Insperger & Stepan, Semi-Discretization for Time-Delay Systems, Springer 2011, ch. 3 and 5.
    """
    found = np.empty(depth.shape, dtype=np.complex128)
    for number in np.unique(intervals):
        rows = np.flatnonzero(intervals == number)
        found[rows] = _equally_divided(system, cut, speed_rpm[rows], depth[rows], int(number), tolerance)
    return found


def _equally_divided(
    system: MillingSystem, cut: Cut, speed_rpm: Floats, depth: Floats, intervals: int, tolerance: float
) -> Complexes:
    """Multipliers where all tooth periods have this many intervals."""
    states = 2 * system.shape.size + system.axes.size * intervals
    solve = _solver(system, cut, intervals)
    speed = np.repeat(speed_rpm, depth.shape[1])[:, np.newaxis]
    value, doubt = _in_threads(solve, speed_rpm[:, np.newaxis], depth, EFFORTS[0])
    value, doubt, cases = value.ravel(), doubt.ravel(), depth.reshape(-1, 1)
    for effort in EFFORTS[1:]:
        open_cases = np.flatnonzero(_in_doubt(value, doubt, tolerance))
        if not open_cases.size:
            break
        again = _in_threads(solve, speed[open_cases], cases[open_cases], (effort[0], min(effort[1], states)))
        value[open_cases], doubt[open_cases] = again[0][:, 0], again[1][:, 0]
    left = np.flatnonzero(_in_doubt(value, doubt, tolerance))
    if left.size:
        worst = left[np.argmax(doubt[left])]
        raise ArithmeticError(
            f"the multiplier at {speed[worst, 0]:g} rpm and {cases[worst, 0] * 1e3:g} mm is not found to {tolerance:g} "
            f"(residual {doubt[worst]:.1e}); leave this speed or depth out"
        )
    return value.reshape(depth.shape)


def _in_doubt(value: Complexes, doubt: Floats, tolerance: float) -> NDArray[np.bool_]:
    return (doubt > tolerance) & ((np.abs(value) < HUGE) | (doubt > 0.5))


Solver = Callable[[Floats, Floats, tuple[int, int]], tuple[Complexes, Floats]]


def _solver(system: MillingSystem, cut: Cut, intervals: int) -> Solver:
    """A function from speeds (s, 1), depths (s, d) and an effort to multipliers and their residuals, each (s, d)."""
    hessenberg = _compiled()
    unit = float(np.max(system.shape))
    states = 2 * system.shape.size + system.axes.size * intervals
    start = np.random.default_rng(0).normal(size=states)

    def forces_at(depth: Floats) -> Floats:
        return interval_forces(cut, intervals, depth)[..., system.axes[:, np.newaxis], system.axes]

    straight = forces_at(np.zeros(1))

    def solve(speed_rpm: Floats, depth: Floats, effort: tuple[int, int]) -> tuple[Complexes, Floats]:
        interval = 60 / (cut.teeth * speed_rpm * intervals)
        angle = system.frequency * interval
        which = np.zeros(depth.shape, dtype=np.int64)
        forces = straight
        if cut.helix_lag > 0:
            depths, which = np.unique(depth, return_inverse=True)
            forces = forces_at(depths)
        matrices = np.empty((*depth.shape, effort[1] + 1, effort[1]))
        hessenberg(
            2 * system.damping_ratio * angle,
            angle**2,
            system.shape / unit,
            system.direction,
            forces,
            which.reshape(depth.shape).astype(np.int64),
            depth * (unit * interval) ** 2,
            start,
            effort[0],
            matrices,
        )
        return _largest(matrices)

    return solve


def _in_threads(solve: Solver, speed: Floats, depth: Floats, effort: tuple[int, int]) -> tuple[Complexes, Floats]:
    workers = 1 if depth.size < SMALL else os.cpu_count() or 1
    pieces = max(4 * workers if workers > 1 else 1, depth.size * effort[1] ** 2 // MEMORY)
    if pieces == 1:
        return solve(speed, depth, effort)
    parts = np.array_split(np.arange(len(depth)), min(pieces, len(depth)))
    with ThreadPoolExecutor(workers) as pool:
        done = list(pool.map(lambda part: solve(speed[part], depth[part], effort), parts))
    return np.concatenate([value for value, _ in done]), np.concatenate([doubt for _, doubt in done])


def _largest(matrices: Floats) -> tuple[Complexes, Floats]:
    """Largest Ritz value of each Hessenberg matrix (..., k + 1, k), and its residual relative to it.

    A period that grows beyond what a number can hold has the multiplier inf.
    """
    finite = np.all(np.isfinite(matrices), axis=(-1, -2))
    matrices = np.where(finite[..., np.newaxis, np.newaxis], matrices, 0.0)
    square = matrices[..., :-1, :]
    values = np.linalg.eigvals(square).astype(np.complex128)
    largest = np.take_along_axis(values, np.argmax(np.abs(values), axis=-1)[..., np.newaxis], axis=-1)
    vector = np.zeros_like(values)
    vector[..., -1] = 1.0
    tiny = np.finfo(np.float64).tiny ** 0.5
    for j in range(values.shape[-1] - 1, 0, -1):
        row = np.einsum("...c,...c->...", square[..., j, j:], vector[..., j:]) - largest[..., 0] * vector[..., j]
        vector[..., j - 1] = -row / np.maximum(square[..., j, j - 1], tiny)
        vector /= np.max(np.abs(vector), axis=-1, keepdims=True)
    residual = matrices[..., -1, -1] * np.abs(vector[..., -1]) / np.linalg.norm(vector, axis=-1)
    found = np.where(finite, largest[..., 0], np.inf)
    return found, residual / np.maximum(np.abs(largest[..., 0]), tiny)


def _compiled() -> Callable[..., None]:
    """The kernel; the first call ever compiles it, which is told."""
    from lobes.kernel import hessenberg

    cache = Path(hessenberg.stats.cache_path)
    if not hessenberg.signatures and not any(cache.glob("kernel.hessenberg-*.nbc")):
        _log.warning("compiling the kernel of the semi-discretisation, once (about 15 s)")
    return hessenberg  # type: ignore[no-any-return]
