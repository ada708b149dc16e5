"""The largest Floquet multiplier of milling."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lobes.floquet.milling_rows import MillingRows
from lobes.floquet.period_map import PeriodMap, period_map
from lobes.floquet.pieces import is_free, segment_ends, segment_pieces
from lobes.floquet.stages import gauss_stages
from lobes.floquet.uneven_map import UnevenMap

EFFORTS = ((10, 6), (20, 8), (12, 14), (20, 24), (40, 40), (80, 80), (80, 600))
"""Power steps and Arnoldi vectors of each attempt; what an attempt leaves in doubt goes on to the next."""
TOLERANCE = 1e-8
"""Largest residual of a multiplier that counts as found, relative to it, unless another is asked for."""
HUGE = 1e6
"""Of larger multipliers only the order of magnitude is found."""
AT_ONCE = 1_600_000
"""Numbers in the matrices of the cases that are solved at once: as much as a processor keeps near."""

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


def largest_multipliers(
    rows: MillingRows,
    depth: Floats,
    numbers: NDArray[np.int64],
    tolerance: float = TOLERANCE,
    kind: type[np.floating[Any]] = np.float64,
) -> Complexes:
    """Multiplier of largest magnitude over one tooth period, of uneven teeth over their pattern, shape (r, d).

    depth (r, d) in m, numbers (r,): pieces of that time (`piece_numbers`). Power steps, then Arnoldi, until the
    residual is below `tolerance` times the multiplier. Raises ArithmeticError for one that stays in doubt.
    """
    if rows.cut.helix_lag > 0 and depth.shape[1] > 1:
        flat = np.repeat(np.arange(len(rows)), depth.shape[1])
        found = largest_multipliers(rows[flat], depth.reshape(-1, 1), numbers[flat], tolerance, kind)
        return found.reshape(depth.shape)
    multipliers = np.empty(depth.shape, dtype=np.complex128)
    for which, pieces in _alike(rows, depth, numbers):
        multipliers[which] = _multipliers(rows[which], depth[which], pieces, tolerance, kind)
    return multipliers


def _alike(
    rows: MillingRows, depth: Floats, numbers: NDArray[np.int64]
) -> Iterator[tuple[NDArray[np.intp], NDArray[np.int64]]]:
    """Rows that are divided alike, few enough to be solved at once, and the pieces of each segment (k,)."""
    ends = segment_ends(rows.cut, depth[:, 0])
    pieces = segment_pieces(rows.cut, numbers, ends)
    free = is_free(rows.cut, ends, depth[:, 0])
    keys, number = np.unique(np.where(free, -np.minimum(pieces, 1), pieces), axis=0, return_inverse=True)
    for i, key in enumerate(keys):
        which = np.flatnonzero(number.ravel() == i)
        states = 2 * rows.direction.size + rows.axes.size * gauss_stages().node.size
        size = depth.shape[1] * states**2 * max(int(np.sum(np.maximum(key, 0))), 1)
        for part in np.array_split(which, -(-which.size * size // AT_ONCE)):
            if part.size:
                yield part, np.abs(key)


def _multipliers(
    rows: MillingRows, depth: Floats, pieces: NDArray[np.int64], tolerance: float, kind: type[np.floating[Any]]
) -> Complexes:
    """Multipliers (r, d) of rows whose tooth periods are divided alike."""
    over_period = period_map(rows, depth, pieces, kind)
    value, doubt = _attempt(over_period, depth.shape, EFFORTS[0])
    for effort in EFFORTS[1:]:
        left = np.nonzero((doubt > tolerance) & ((np.abs(value) < HUGE) | (doubt > 0.5)))
        if not left[0].size:
            return value
        again = _attempt(over_period[left[0], left[1]], (left[0].size, 1), effort)
        value[left], doubt[left] = again[0][:, 0], again[1][:, 0]
    row, column = np.unravel_index(np.argmax(np.where(np.abs(value) < HUGE, doubt, 0.0)), doubt.shape)
    if doubt[row, column] <= tolerance:
        return value
    raise ArithmeticError(
        f"the multiplier at {rows.speed_rpm[row]:g} rpm and {depth[row, column] * 1e3:g} mm is not found to "
        f"{tolerance:g} (residual {doubt[row, column]:.1e}); leave this speed or depth out"
    )


def _attempt(
    over_period: PeriodMap | UnevenMap, shape: tuple[int, ...], effort: tuple[int, int]
) -> tuple[Complexes, Floats]:
    """Multipliers and residuals, each of a shape (r, d), after some power steps with some Arnoldi vectors."""
    states = over_period.states
    start = np.random.default_rng(0).normal(size=states).astype(over_period.kind)
    state = np.broadcast_to(start, (*shape, states))
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        for _ in range(effort[0]):
            state = over_period(state)
            state = state / np.linalg.norm(state, axis=-1, keepdims=True)
        return _largest(_hessenberg(over_period, state, min(effort[1], states)))


def _hessenberg(over_period: PeriodMap | UnevenMap, start: Floats, vectors: int) -> Floats:
    """Hessenberg matrices (..., k + 1, k) of k Arnoldi steps; zeros from where the space is exhausted."""
    basis = np.zeros((*start.shape[:-1], vectors + 1, start.shape[-1]), start.dtype)
    basis[..., 0, :] = start / np.linalg.norm(start, axis=-1, keepdims=True)
    matrix = np.zeros((*start.shape[:-1], vectors + 1, vectors), start.dtype)
    for k in range(vectors):
        new, earlier = over_period(basis[..., k, :]), basis[..., : k + 1, :]
        for _ in range(2):
            overlap = (earlier @ new[..., np.newaxis])[..., 0]
            matrix[..., : k + 1, k] += overlap
            new = new - (overlap[..., np.newaxis, :] @ earlier)[..., 0, :]
        length = np.linalg.norm(new, axis=-1)
        matrix[..., k + 1, k] = length
        basis[..., k + 1, :] = new / np.where(length > 0, length, 1.0)[..., np.newaxis]
    return matrix


def _largest(matrices: Floats) -> tuple[Complexes, Floats]:
    """Largest Ritz value of each Hessenberg matrix (..., k + 1, k), and its residual relative to it.

    The residual is that of any that may be larger by as much: two that are nearly one look smaller until they part.
    A period that grows beyond what a number can hold has the multiplier inf.
    """
    finite = np.all(np.isfinite(matrices), axis=(-1, -2))
    matrices = np.where(finite[..., np.newaxis, np.newaxis], matrices, 0.0)
    values = np.linalg.eigvals(matrices[..., :-1, :]).astype(np.complex128)
    size, residual = np.abs(values), _residuals(matrices, values)
    place = np.argmax(size, axis=-1)[..., np.newaxis]
    most = np.take_along_axis(size, place, axis=-1)
    doubt = np.max(np.where(size + residual >= most, residual, 0.0), axis=-1)
    largest = np.take_along_axis(values, place, axis=-1)[..., 0]
    return np.where(finite, largest, np.inf), doubt / np.maximum(most[..., 0], np.finfo(matrices.dtype).tiny ** 0.5)


def _residuals(matrices: Floats, values: Complexes) -> Floats:
    """Residuals of Ritz values (..., k) of Hessenberg matrices (..., k + 1, k), by their vectors of norm 1."""
    square, tiny = matrices[..., :-1, :], np.finfo(matrices.dtype).tiny ** 0.5
    vector = np.zeros((*values.shape, values.shape[-1]), dtype=values.dtype)
    vector[..., -1] = 1.0
    for j in range(values.shape[-1] - 1, 0, -1):
        row = (vector[..., j:] @ square[..., j, j:, np.newaxis])[..., 0] - values * vector[..., j]
        vector[..., j - 1] = -row / np.maximum(square[..., j, j - 1], tiny)[..., np.newaxis]
        vector /= np.max(np.abs(vector), axis=-1, keepdims=True)
    return np.asarray(matrices[..., -1, -1, np.newaxis] * np.abs(vector[..., -1]) / np.linalg.norm(vector, axis=-1))
