"""Largest Floquet multiplier of milling, its magnitude, and the growth rate."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from lobes.floquet.milling_rows import MillingRows, divide_segments, is_out_of_cut, segment_ends
from lobes.floquet.period_map import AnyMap, build_period_map
from lobes.floquet.piece_response import Precision, gauss_nodes
from modal.arrays import Complexes, Flags, Floats, Indices, Integers

ARNOLDI_ATTEMPTS = ((10, 8), (0, 12), (0, 24), (40, 40), (80, 80), (80, 600))
"""Power steps and Arnoldi vectors of each attempt for cases that have not converged.

An attempt without power steps keeps the vectors of the one before.
"""
MULTIPLIER_TOLERANCE = 1e-8
"""Default of the largest residual of a multiplier, relative to it."""
MAX_RESOLVED_MULTIPLIER = 1e6
"""Largest multiplier that is computed accurately; of larger ones only the order of magnitude counts."""
SQUARINGS_BEFORE_CHECK = 4
"""Squarings of a matrix after which smaller Ritz values count as error: 0.5 of the largest has become 1.5e-5."""
EXTRA_SQUARINGS = 6
"""Squarings beyond those that bring the share of a number near 1 below the tolerance."""
SQUARINGS_PER_SCALING = 4
"""Squarings between scalings: the power 16 of a scaled matrix does not overflow."""
MAX_BATCH_NUMBERS = 800_000
"""Most matrix entries of the cases solved at once, for the processor cache."""

RitzFunction = Callable[[Floats], tuple[Complexes, Floats]]
"""Function from Hessenberg matrices (..., k + 1, k) to the largest Ritz value, and its relative residual.

The residual is that of any value that may be larger by as much, since two that are nearly equal look smaller until
they separate. A period that grows beyond the number range has the multiplier inf.
"""


def largest_multipliers(
    rows: MillingRows, depth: Floats, numbers: Integers, tolerance: float = MULTIPLIER_TOLERANCE
) -> Complexes:
    """Return the multiplier of largest magnitude over one tooth period, or one pitch pattern.

    Power steps, then Arnoldi, until the residual is below `tolerance` times the multiplier.

    Parameters
    ----------
    rows : MillingRows
        Batch of r systems.
    depth : ndarray, shape (r, d)
        Axial depths (m).
    numbers : ndarray of int, shape (r,)
        Pieces of the period (`count_pieces`).
    tolerance : float
        Largest relative residual (-).

    Returns
    -------
    ndarray of complex, shape (r, d)
        Multipliers; stable below magnitude 1.

    Raises
    ------
    ArithmeticError
        If a multiplier does not converge.
    """
    return _largest_in_batches(rows, depth, numbers, tolerance, np.float64, _ritz_value)


def spectral_radii(
    rows: MillingRows, depth: Floats, numbers: Integers, tol: float = MULTIPLIER_TOLERANCE, kind: Precision = np.float64
) -> Floats:
    """Return the magnitude of the largest multipliers, faster: eigenvalues only if powers do not converge.

    kind: precision.
    """

    def radius(matrices: Floats) -> tuple[Complexes, Floats]:
        value, doubt = _ritz_radius(matrices, math.ceil(-math.log2(tol)) + EXTRA_SQUARINGS)
        left = doubt > tol
        value[left], doubt[left] = _ritz_value(matrices[left])
        return value, doubt

    return np.abs(_largest_in_batches(rows, depth, numbers, tol, kind, radius))


def _largest_in_batches(
    rows: MillingRows, depth: Floats, numbers: Integers, tol: float, kind: Precision, ritz: RitzFunction
) -> Complexes:
    """Compute values of the largest multipliers (r, d) in batches."""
    if rows.cut.helix_lag > 0 and depth.shape[1] > 1:
        flat = np.repeat(np.arange(len(rows)), depth.shape[1])
        found = _largest_in_batches(rows[flat], depth.reshape(-1, 1), numbers[flat], tol, kind, ritz)
        return found.reshape(depth.shape)
    multipliers = np.empty(depth.shape, dtype=np.complex128)
    for which, pieces in _equal_division_groups(rows, depth, numbers):
        over_period = build_period_map(rows[which], depth[which], pieces, kind)
        multipliers[which] = _arnoldi_multipliers(rows[which], depth[which], over_period, tol, ritz)
    return multipliers


def _equal_division_groups(rows: MillingRows, depth: Floats, numbers: Integers) -> Iterator[tuple[Indices, Integers]]:
    """Yield rows with equal divisions, few enough to be solved at once, and the pieces of each segment (k,)."""
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
    rows: MillingRows, depth: Floats, over_period: AnyMap, tolerance: float, ritz: RitzFunction
) -> Complexes:
    """Return the multipliers (r, d) of rows with equal divisions."""
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
        f"the multiplier at {rows.speed_rpm[row]:g} rpm and {depth[row, column] * 1e3:g} mm has not converged to "
        f"{tolerance:g} (residual {doubt[row, column]:.1e}). Leave this speed or depth out."
    )


@dataclass(frozen=True, eq=False)
class _KrylovSpace:
    """Krylov spaces of cases (r, d) by Arnoldi."""

    over_period: AnyMap
    """Period map of each case."""
    basis: Floats
    """Orthonormal vectors, shape (r, d, k + 1, states)."""
    matrix: Floats
    """Hessenberg matrices, shape (r, d, k + 1, k); zeros from where a space is exhausted."""

    @classmethod
    def of(cls, over_period: AnyMap, shape: tuple[int, ...], steps: int) -> "_KrylovSpace":
        """Return the first vectors (k = 0): a random one after some power steps."""
        zero = over_period.zero_state
        start = np.random.default_rng(0).normal(size=zero.size).astype(zero.dtype)
        state = np.broadcast_to(start / np.linalg.norm(start), (*shape, start.size))
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            for _ in range(steps):
                state = over_period(state)
                state = state / np.linalg.norm(state, axis=-1, keepdims=True)
        return cls(over_period, state[..., np.newaxis, :], np.zeros((*shape, 1, 0), start.dtype))

    def __getitem__(self, which: tuple[Indices, ...]) -> "_KrylovSpace":
        """Select c of the cases, as (c, 1)."""
        basis, matrix = self.basis[which], self.matrix[which]
        return _KrylovSpace(self.over_period[which[0], which[1]], basis[:, np.newaxis], matrix[:, np.newaxis])

    def grown(self, vectors: int) -> "_KrylovSpace":
        """Return the spaces with so many vectors, at most the number of states."""
        more = min(vectors, self.basis.shape[-1]) - self.matrix.shape[-1]
        beside = ((0, 0),) * (self.matrix.ndim - 2)
        basis = np.pad(self.basis, (*beside, (0, more), (0, 0)))
        matrix = np.pad(self.matrix, (*beside, (0, more), (0, more)))
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            for k in range(self.matrix.shape[-1], matrix.shape[-1]):
                self._add(basis, matrix, k)
        return replace(self, basis=basis, matrix=matrix)

    def _add(self, basis: Floats, matrix: Floats, k: int) -> None:
        """Add vector k + 1 and column k in place."""
        new, earlier = self.over_period(basis[..., k, :]), basis[..., : k + 1, :]
        for _ in range(2):
            overlap = (earlier @ new[..., np.newaxis])[..., 0]
            matrix[..., : k + 1, k] += overlap
            new = new - (overlap[..., np.newaxis, :] @ earlier)[..., 0, :]
        length = np.linalg.norm(new, axis=-1)
        matrix[..., k + 1, k] = length
        basis[..., k + 1, :] = new / np.where(length > 0, length, 1.0)[..., np.newaxis]


def _ritz_value(matrices: Floats) -> tuple[Complexes, Floats]:
    """Return the largest Ritz value and its residual."""
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
    """Return the magnitude of the largest Ritz value, from the size of the matrix's power 2^squarings.

    The last row of the power 2^SQUARINGS_BEFORE_CHECK over all of it is the last component of the dominant vectors,
    which
    gives the residual.
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
    last = matrices[..., -1, -1] * share / np.maximum(radius, _tiny_value(matrices))
    return np.where(finite, radius, np.inf) + 0j, last


def _zero_non_finite(matrices: Floats) -> tuple[Floats, Flags]:
    """Replace matrices that are not finite by 0, and return which are finite."""
    finite = np.all(np.isfinite(matrices), axis=(-1, -2))
    return np.where(finite[..., np.newaxis, np.newaxis], matrices, 0.0), finite


def _tiny_value(matrices: Floats) -> float:
    return float(np.finfo(matrices.dtype).tiny ** 0.5)


MULTIPLIER_RANGE = (1e-300, 1e300)
"""Smallest and largest resolved magnitude of multipliers."""
SINGLE_PRECISION_ACCURACY = 1e-5
"""Accuracy from which single precision is sufficient."""
RESIDUAL_PER_ACCURACY = 0.1
"""Residual of a multiplier over the requested accuracy: the error of a non-normal map is several residuals."""


def growth_rate(rows: MillingRows, depth: Floats, numbers: Integers, tolerance: float = 1e-4) -> Floats:
    """Return the logarithm of the largest multiplier's magnitude; negative for a stable cut.

    With tolerance 1e-4 the error was 2.2e-5 at most within 0.2 of zero, with `COARSE_CYCLES_PER_PIECE` 6.9e-5: 12 906
    depths of 1500 random programs with up to twelve modes, including helical teeth and immersions down to 0.03.

    Parameters
    ----------
    rows : MillingRows
        Batch of r systems.
    depth : ndarray, shape (r, d)
        Axial depths (m).
    numbers : ndarray of int, shape (r,)
        Pieces of the tooth period (`count_pieces`).
    tolerance : float
        Accuracy of the result near zero (-).

    Returns
    -------
    ndarray, shape (r, d)
        Growth over one tooth period (-).

    References
    ----------
    As `spectral_radius`, whose logarithm it is.

    Examples
    --------
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
