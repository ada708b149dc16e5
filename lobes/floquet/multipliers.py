"""Largest Floquet multiplier of milling, its magnitude, and the growth rate."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lobes.arrays import Complexes, Flags, Floats, Indices, Integers
from lobes.floquet.milling_rows import MillingRows, divide_segments, is_out_of_cut, segment_ends
from lobes.floquet.period_map import PeriodMap, UnevenMap, build_period_map
from lobes.floquet.piece_response import gauss_nodes

ARNOLDI_ATTEMPTS = ((10, 8), (0, 12), (0, 24), (40, 40), (80, 80), (80, 600))
"""Power steps and Arnoldi vectors of each attempt; what is left in doubt goes on to the next, with the vectors that it
has where that takes no power steps."""
MULTIPLIER_TOLERANCE = 1e-8
"""Largest residual of a multiplier that counts as found, relative to it, unless another is asked for."""
MAX_RESOLVED_MULTIPLIER = 1e6
"""Of larger multipliers only the order of magnitude is found."""
SQUARINGS_BEFORE_CHECK = 4
"""Squarings of a matrix after which what is still seen of smaller Ritz values counts as doubt: 0.5 of the largest has
become 1.5e-5 by then."""
EXTRA_SQUARINGS = 6
"""Squarings beyond those that bring the share of a number near 1 below the tolerance: sizes of powers are off by some.
"""
SQUARINGS_PER_SCALING = 4
"""Squarings without a look at the size: powers of 16 of what is scaled to 1 still are numbers."""
MAX_BATCH_NUMBERS = 800_000
"""Numbers in the matrices of the cases that are solved at once: as much as a processor keeps near."""

RitzFunction = Callable[[Floats], tuple[Complexes, Floats]]
"""From Hessenberg matrices (..., k + 1, k) to what is wanted of the largest Ritz value, and its residual over its size:
that of any that may be larger by as much, since two that are nearly one look smaller until they part. A period that
grows beyond what a number can hold has the multiplier inf."""


def largest_multipliers(
    rows: MillingRows, depth: Floats, numbers: Integers, tolerance: float = MULTIPLIER_TOLERANCE
) -> Complexes:
    """Multiplier of largest magnitude over one tooth period, of uneven teeth over their pattern, shape (r, d).

    depth (r, d) in m, numbers (r,): pieces of that time (`count_pieces`). Power steps, then Arnoldi, until the
    residual is below `tolerance` times the multiplier. Raises ArithmeticError for one that stays in doubt.
    """
    return _largest_in_batches(rows, depth, numbers, tolerance, np.float64, _ritz_value)


def spectral_radii(
    rows: MillingRows,
    depth: Floats,
    numbers: Integers,
    tolerance: float = MULTIPLIER_TOLERANCE,
    kind: type[np.floating[Any]] = np.float64,
) -> Floats:
    """Magnitude of it, in less time: eigenvalues are taken where powers leave it in doubt. kind: precision."""

    def radius(matrices: Floats) -> tuple[Complexes, Floats]:
        value, doubt = _ritz_radius(matrices, math.ceil(-math.log2(tolerance)) + EXTRA_SQUARINGS)
        left = doubt > tolerance
        value[left], doubt[left] = _ritz_value(matrices[left])
        return value, doubt

    return np.abs(_largest_in_batches(rows, depth, numbers, tolerance, kind, radius))


def _largest_in_batches(
    rows: MillingRows,
    depth: Floats,
    numbers: Integers,
    tolerance: float,
    kind: type[np.floating[Any]],
    ritz: RitzFunction,
) -> Complexes:
    """What is wanted of the largest multipliers (r, d)."""
    if rows.cut.helix_lag > 0 and depth.shape[1] > 1:
        flat = np.repeat(np.arange(len(rows)), depth.shape[1])
        found = _largest_in_batches(rows[flat], depth.reshape(-1, 1), numbers[flat], tolerance, kind, ritz)
        return found.reshape(depth.shape)
    multipliers = np.empty(depth.shape, dtype=np.complex128)
    for which, pieces in _equal_division_groups(rows, depth, numbers):
        over_period = build_period_map(rows[which], depth[which], pieces, kind)
        multipliers[which] = _arnoldi_multipliers(rows[which], depth[which], over_period, tolerance, ritz)
    return multipliers


def _equal_division_groups(rows: MillingRows, depth: Floats, numbers: Integers) -> Iterator[tuple[Indices, Integers]]:
    """Rows that are divided alike, few enough to be solved at once, and the pieces of each segment (k,)."""
    ends = segment_ends(rows.cut, depth[:, 0])
    pieces = divide_segments(rows.cut, numbers, ends)
    free = is_out_of_cut(rows.cut, ends, depth[:, 0])
    keys, number = np.unique(np.where(free, -np.minimum(pieces, 1), pieces), axis=0, return_inverse=True)
    for i, key in enumerate(keys):
        which = np.flatnonzero(number.ravel() == i)
        states = 2 * rows.direction.size + rows.axes.size * gauss_nodes().node.size
        size = depth.shape[1] * states**2 * max(int(np.sum(np.maximum(key, 0))), 1)
        for part in np.array_split(which, -(-which.size * size // MAX_BATCH_NUMBERS)):
            if part.size:
                yield part, np.abs(key)


def _arnoldi_multipliers(
    rows: MillingRows, depth: Floats, over_period: PeriodMap | UnevenMap, tolerance: float, ritz: RitzFunction
) -> Complexes:
    """Multipliers (r, d) of rows whose tooth periods are divided alike."""
    space = _KrylovSpace.of(over_period, depth.shape, ARNOLDI_ATTEMPTS[0][0]).grown(ARNOLDI_ATTEMPTS[0][1])
    value, doubt = ritz(space.matrix)
    place = np.indices(depth.shape)
    for steps, vectors in ARNOLDI_ATTEMPTS[1:]:
        size, error = np.abs(value[*place]), doubt[*place]
        left = np.nonzero((error > tolerance) & ((size < MAX_RESOLVED_MULTIPLIER) | (error > 0.5)))
        if not left[0].size:
            return value
        space, place = space[left], place[:, *left, np.newaxis]
        space = (_KrylovSpace.of(space.over_period, place[0].shape, steps) if steps else space).grown(vectors)
        value[*place], doubt[*place] = ritz(space.matrix)
    doubt = np.where(np.abs(value) < MAX_RESOLVED_MULTIPLIER, doubt, 0.0)
    row, column = np.unravel_index(np.argmax(doubt), doubt.shape)
    if doubt[row, column] <= tolerance:
        return value
    raise ArithmeticError(
        f"the multiplier at {rows.speed_rpm[row]:g} rpm and {depth[row, column] * 1e3:g} mm is not found to "
        f"{tolerance:g} (residual {doubt[row, column]:.1e}); leave this speed or depth out"
    )


@dataclass(frozen=True, eq=False)
class _KrylovSpace:
    """Krylov spaces of cases (r, d), as Arnoldi spans them."""

    over_period: PeriodMap | UnevenMap
    """Map of each."""
    basis: Floats
    """Vectors of norm 1 at right angles, shape (r, d, k + 1, states)."""
    matrix: Floats
    """Hessenberg matrices, shape (r, d, k + 1, k); zeros from where a space is exhausted."""

    @classmethod
    def of(cls, over_period: PeriodMap | UnevenMap, shape: tuple[int, ...], steps: int) -> _KrylovSpace:
        """The first vectors (k = 0): a random one after some power steps."""
        start = np.random.default_rng(0).normal(size=over_period.states).astype(over_period.kind)
        state = np.broadcast_to(start / np.linalg.norm(start), (*shape, start.size))
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            for _ in range(steps):
                state = over_period(state)
                state = state / np.linalg.norm(state, axis=-1, keepdims=True)
        return cls(over_period, state[..., np.newaxis, :], np.zeros((*shape, 1, 0), start.dtype))

    def __getitem__(self, which: tuple[Indices, ...]) -> _KrylovSpace:
        """Some of the cases, c of them, as (c, 1)."""
        row, column = which
        return _KrylovSpace(
            self.over_period[row, column], self.basis[which][:, np.newaxis], self.matrix[which][:, np.newaxis]
        )

    def grown(self, vectors: int) -> _KrylovSpace:
        """The spaces of so many vectors, of as many as there are numbers in a state at most."""
        more = min(vectors, self.basis.shape[-1]) - self.matrix.shape[-1]
        beside = ((0, 0),) * (self.matrix.ndim - 2)
        basis = np.pad(self.basis, (*beside, (0, more), (0, 0)))
        matrix = np.pad(self.matrix, (*beside, (0, more), (0, more)))
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            for k in range(self.matrix.shape[-1], matrix.shape[-1]):
                self._add(basis, matrix, k)
        return replace(self, basis=basis, matrix=matrix)

    def _add(self, basis: Floats, matrix: Floats, k: int) -> None:
        """Vector k + 1 and column k, in place."""
        new, earlier = self.over_period(basis[..., k, :]), basis[..., : k + 1, :]
        for _ in range(2):
            overlap = (earlier @ new[..., np.newaxis])[..., 0]
            matrix[..., : k + 1, k] += overlap
            new = new - (overlap[..., np.newaxis, :] @ earlier)[..., 0, :]
        length = np.linalg.norm(new, axis=-1)
        matrix[..., k + 1, k] = length
        basis[..., k + 1, :] = new / np.where(length > 0, length, 1.0)[..., np.newaxis]


def _ritz_value(matrices: Floats) -> tuple[Complexes, Floats]:
    """The Ritz value itself."""
    matrices, finite = _zero_non_finite(matrices)
    values, vectors = np.linalg.eig(matrices[..., :-1, :])
    values = values.astype(np.complex128)
    size, residual = np.abs(values), matrices[..., -1, -1, np.newaxis] * np.abs(vectors[..., -1, :])
    place = np.argmax(size, axis=-1)[..., np.newaxis]
    most = np.take_along_axis(size, place, axis=-1)
    doubt = np.max(np.where(size + residual >= most, residual, 0.0), axis=-1)
    largest = np.take_along_axis(values, place, axis=-1)[..., 0]
    return np.where(finite, largest, np.inf), doubt / np.maximum(most[..., 0], _tiny_value(matrices))


def _ritz_radius(matrices: Floats, squarings: int) -> tuple[Complexes, Floats]:
    """Its magnitude, from the size of the matrix's power 2^squarings.

    The last row of the power 2^LOOK over all of it is the last component of the vectors that are largest by then:
    theirs is the residual.
    Source: Gelfand's formula, Horn & Johnson, Matrix Analysis, 2nd ed., corollary 5.6.14.
    """
    matrices, finite = _zero_non_finite(matrices)
    power, log = matrices[..., :-1, :].astype(np.float64), np.zeros(finite.shape)
    for i in range(squarings + 1):
        if i % SQUARINGS_PER_SCALING == 0 or i == squarings:
            size = np.maximum(np.max(np.abs(power), axis=(-1, -2)), np.finfo(np.float64).tiny)
            log += np.log(size) / 2**i
            power /= size[..., np.newaxis, np.newaxis]
        if i == SQUARINGS_BEFORE_CHECK:
            rows = np.sum(power**2, axis=-1)
            share = np.sqrt(rows[..., -1] / np.maximum(np.sum(rows, axis=-1), np.finfo(np.float64).tiny))
        power = power @ power
    radius = np.exp(log)
    return np.where(finite, radius, np.inf) + 0j, matrices[..., -1, -1] * share / np.maximum(
        radius, _tiny_value(matrices)
    )


def _zero_non_finite(matrices: Floats) -> tuple[Floats, Flags]:
    """The matrices with 0 for those that are not finite, and which are."""
    finite = np.all(np.isfinite(matrices), axis=(-1, -2))
    return np.where(finite[..., np.newaxis, np.newaxis], matrices, 0.0), finite


def _tiny_value(matrices: Floats) -> float:
    return float(np.finfo(matrices.dtype).tiny ** 0.5)


MULTIPLIER_RANGE = (1e-300, 1e300)
"""Magnitudes of multipliers that are told apart."""
SINGLE_PRECISION_ACCURACY = 1e-5
"""Accuracy from which on numbers of single precision will do."""
RESIDUAL_PER_ACCURACY = 0.1
"""Residual of a multiplier over the accuracy that is asked for: that of a map that is not normal is off by several."""


def growth_rate(rows: MillingRows, depth: Floats, numbers: Integers, tolerance: float = 1e-4) -> Floats:
    """Logarithm of the largest multiplier's magnitude at depths (r, d) in m, shape (r, d); negative where stable.

    numbers (r,): pieces of the tooth period (`count_pieces`); tolerance: accuracy of the result near zero. With 1e-4
    it was off by 2.2e-5 at most where it is within 0.2 of zero, with `COARSE_CYCLES_PER_PIECE` pieces by 6.9e-5: 12 906 depths of 1500
    random programs, up to twelve modes, helical ones and radial depths of 0.03 diameters among them.
    Source: as `spectral_radius`, whose logarithm it is.

    >>> mode = Mode(frequency=500.0, damping_ratio=0.02, stiffness=2e7)
    >>> slot = Cut(teeth=2, immersion=1.0, direction="up", tangential=700e6, radial=200e6)
    >>> rows = rows_at_speeds(build_milling_system([mode], [mode]), slot, np.array([12000.0]))
    >>> depths = np.array([[1e-9, 2e-3]])  # m
    >>> growth_rate(rows, depths, count_pieces(rows, 2e-3)).round(3).tolist()  # -zeta w T = -0.157 without a cut
    [[-0.157, -0.042]]
    """
    kind = np.float32 if tolerance >= SINGLE_PRECISION_ACCURACY else np.float64
    radii = spectral_radii(rows, depth, numbers, RESIDUAL_PER_ACCURACY * tolerance, kind)
    return np.asarray(np.log(np.clip(radii, *MULTIPLIER_RANGE)))
