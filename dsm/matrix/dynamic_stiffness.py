"""Dynamic stiffness matrix of a whole shaft, its factor, and the count of modes below a frequency."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple, Protocol, TypeVar

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from dsm.arrays import Flags, Floats, Indices
from dsm.spindle.segment import nearest_index, nearest_indices


def check_frequencies(frequency: ArrayLike) -> Floats:
    """The frequencies (Hz) as an array of shape (n,), one number as (1,); ValueError unless finite and >= 0."""
    f = np.atleast_1d(np.asarray(frequency, dtype=np.float64))
    if f.ndim != 1:
        raise ValueError(f"frequency has shape {f.shape}; a 1-D array (Hz) is needed")
    bad = f[~(np.isfinite(f) & (f >= 0))]
    if bad.size:
        raise ValueError(f"frequency={bad[0]} Hz is not a finite number >= 0")
    return f


class SymmetricFactor(NamedTuple):
    """L D L^T by the pivoting of Bunch and Kaufman, as LAPACK keeps it."""

    values: Floats
    """L, and D of 1 x 1 and 2 x 2 blocks."""
    pivots: NDArray[np.int32]
    """Rows exchanged; negative ones belong to 2 x 2 blocks, which have one negative eigenvalue each."""

    @property
    def negative(self) -> int:
        """Number of negative eigenvalues (Sylvester's law of inertia)."""
        single = self.pivots > 0
        pairs = (self.pivots.size - np.count_nonzero(single)) // 2
        return int(np.count_nonzero(self.values.diagonal()[single] < 0) + pairs)

    def solve(self, right: Floats) -> Floats:
        """Solutions of matrix times y = right, shape (n, m)."""
        return np.asarray(scipy.linalg.lapack.dsytrs(self.values, self.pivots, right, lower=1)[0])


def symmetric_factor(matrix: Floats) -> SymmetricFactor:
    """The factor of a matrix (n, n) in Fortran's order, its lower half alone looked at; the matrix is overwritten."""
    values, pivots, _ = scipy.linalg.lapack.dsytrf(matrix, lower=1, overwrite_a=1)
    return SymmetricFactor(values, pivots)


Number = TypeVar("Number", np.float64, np.complex128)


class _PositionedPart(Protocol):
    """A part of a spindle."""

    @property
    def position(self) -> float:
        """Distance from the tool tip (m)."""


@dataclass(frozen=True, eq=False)
class DynamicStiffness:
    """Stiffness matrix K of a chain of beam elements, a polynomial in w^2 (w the angular frequency, rad/s).

    For a shaft that spins it is a polynomial in w, for the circular whirl u exp(i w t) of both planes together. What
    is called eigenvalue below is w^2, or w where it spins. Lumped masses, bearings and joints of no length are in it.
    Node i has the deflection u_i and the slope t_i = du/dz, in this order. Between two nodes that are very near to each
    other, or on both sides of a joint, stands a node of force and moment instead: a link, with its flexibility in place
    of its stiffness, whose rounding would drown all else (link_elements). A dof that is held has its row and column
    replaced by those of the unit matrix: it stays at zero and adds a positive pivot; a link adds two negative ones.
    Exact for w up to that of `top_frequency`, where no element has a clamped natural frequency of its own (J0 = 0 of
    Wittrick and Williams).
    """

    position: Floats
    """Nodes from the tool tip on (m), shape (n_nodes,); inf for those of force and moment."""
    diagonal: Floats
    """Coefficients of K(u_i, u_i), K(u_i, t_i), K(t_i, t_i) in powers of the eigenvalue, (3, n_nodes, n_terms)."""
    coupling: Floats
    """The same of K(u_i, u_j), K(u_i, t_j), K(t_i, u_j), K(t_i, t_j), j = i + 1, shape (4, n_nodes - 1, n_terms)."""
    held: Flags
    """Dofs that cannot move, shape (n_nodes, 2)."""
    scale: Floats
    """Factors on rows and columns of a full matrix that make them of one size, shape (2 n_nodes,)."""
    top_frequency: float
    """Highest frequency of interest (Hz)."""
    spin: float | None = None
    """Speed of rotation (rad/s); forward whirl turns with it. None: the polynomial is one in w^2."""

    @property
    def is_link(self) -> Flags:
        """Which nodes are those of force and moment, shape (n_nodes,)."""
        return np.isinf(self.position)

    @cached_property
    def link_pivots(self) -> int:
        """Negative pivots that belong to links: two each, but for forces that are held at zero."""
        return int(np.count_nonzero(~self.held[self.is_link]))

    def to_eigenvalue(self, frequency: Floats) -> Floats:
        """The variable of the polynomial at frequencies (Hz), any shape."""
        w = 2 * np.pi * frequency
        return np.asarray(w if self.spin is not None else w * w)

    def to_frequency(self, eigenvalue: Floats) -> Floats:
        """Frequencies (Hz) at values of the variable, any shape."""
        return np.asarray((eigenvalue if self.spin is not None else np.sqrt(eigenvalue)) / (2 * np.pi))

    def node(self, position: float) -> int:
        """Index of the node nearest to a position (m)."""
        return nearest_index(self.position, position)

    def dofs(self, parts: Sequence[_PositionedPart]) -> Indices:
        """Indices of the deflections of the nodes of parts in a full matrix, shape (n,)."""
        if not parts:
            return np.zeros(0, dtype=int)
        return 2 * nearest_indices(self.position, [part.position for part in parts])

    def blocks(self, eigenvalue: NDArray[Number], derivative: bool = False) -> tuple[NDArray[Number], NDArray[Number]]:
        """Values of diagonal (3, n_nodes, n) and coupling (4, n_nodes - 1, n), in SI units, at eigenvalues (n,).

        These may be complex or negative. With `derivative`, those of dK by the eigenvalue.
        """
        powers = self._powers(eigenvalue, derivative)
        return self.diagonal @ powers, self.coupling @ powers

    def dense(self, eigenvalue: NDArray[Number], derivative: bool = False) -> NDArray[Number]:
        """K, or its derivative by the eigenvalue, as full matrices of shape (n, 2 n_nodes, 2 n_nodes)."""
        return full_matrices(*self.blocks(eigenvalue, derivative))

    def scaled(self, eigenvalue: Floats) -> list[Floats]:
        """K at each eigenvalue, rows and columns times `scale`, in Fortran's order; the lower half, 0 above it."""
        place, coefficients = self._lower
        matrices = np.zeros((eigenvalue.size, self.scale.size**2))
        matrices[:, place] = (coefficients @ self._powers(eigenvalue)).T
        return [matrix.reshape(self.scale.size, -1).T for matrix in matrices]

    def slope_of(self, eigenvalue: Floats, shape: Floats) -> Floats:
        """phi^T K' phi at each eigenvalue (n,), K' its derivative, of a motion phi = `scale` times shape."""
        place, coefficients = self._lower
        column, row = np.divmod(place, self.scale.size)
        twice = np.where(row == column, 1.0, 2.0) * shape[row] * shape[column]
        return np.asarray((twice @ coefficients) @ self._powers(eigenvalue, derivative=True))

    @cached_property
    def _lower(self) -> tuple[Indices, Floats]:
        """Places in the flattened matrix, columns one after the other, and scaled coefficients of its lower half."""
        rows, columns = _lower_half(self.position.size)
        terms = self.diagonal.shape[2]
        coefficients = np.concatenate([self.diagonal.reshape(-1, terms), self.coupling.reshape(-1, terms)])
        coefficients *= (self.scale[rows] * self.scale[columns])[:, np.newaxis]
        return columns * self.scale.size + rows, coefficients

    def _powers(self, eigenvalue: NDArray[Number], derivative: bool = False) -> NDArray[Number]:
        """Powers of each eigenvalue, or their derivatives, shape (n_terms, n)."""
        powers = np.empty((self.diagonal.shape[2], eigenvalue.size), dtype=eigenvalue.dtype)
        powers[0], powers[1:] = 1.0, eigenvalue
        np.multiply.accumulate(powers, out=powers)
        if derivative:
            powers[1:] = np.arange(1, powers.shape[0])[:, np.newaxis] * powers[:-1]
            powers[0] = 0.0
        return powers

    def solve(self, matrices: NDArray[Number], right: NDArray[Number]) -> NDArray[Number]:
        """Solutions of full matrices times y = right, shape (n, 2 n_nodes, m), rows and columns made of one size."""
        scale = self.scale[:, np.newaxis]
        solution = np.linalg.solve(matrices * (scale * self.scale), scale * right)
        return np.asarray(scale * solution, dtype=matrices.dtype)

    def solve_singular(self, matrices: NDArray[Number], right: NDArray[Number]) -> NDArray[Number]:
        """The same for inverse iteration: of matrices that are singular, of those that are equal but for rounding.

        Peters and Wilkinson, SIAM Review 21 (1979): a pivot of zero may be replaced by one of rounding's size.
        """
        try:
            return self.solve(matrices, right)
        except np.linalg.LinAlgError:
            rounding = np.diag(np.finfo(np.float64).eps / self.scale**2)
            return self.solve(np.asarray(matrices + rounding, dtype=matrices.dtype), right)

    def term(self, power: int) -> Floats:
        """Coefficient of one power of the eigenvalue in K, a full matrix of shape (2 n_nodes, 2 n_nodes)."""
        return np.asarray(
            full_matrices(self.diagonal[..., power : power + 1], self.coupling[..., power : power + 1])[0]
        )


def full_matrices(diagonal: NDArray[Number], coupling: NDArray[Number]) -> NDArray[Number]:
    """Full matrices, shape (n, 2 n_nodes, 2 n_nodes), of blocks as in DynamicStiffness.blocks."""
    uu, ut, tt = diagonal
    size = 2 * uu.shape[0]
    matrices = np.zeros((uu.shape[1], size * size), dtype=uu.dtype)
    matrices[:, _block_indices(uu.shape[0])] = np.concatenate([uu, ut, ut, tt, *coupling, *coupling]).T
    return matrices.reshape(-1, size, size)


@lru_cache(maxsize=32)
def _lower_half(n_nodes: int) -> tuple[Indices, Indices]:
    """Rows and columns of the blocks on and below the diagonal, in the order of diagonal and coupling."""
    u = 2 * np.arange(n_nodes)
    left, right = u[:-1], u[1:]
    pairs = [(u, u), (u + 1, u), (u + 1, u + 1)]
    pairs += [(right, left), (right + 1, left), (right, left + 1), (right + 1, left + 1)]
    rows, columns = (np.concatenate(part) for part in zip(*pairs, strict=True))
    return rows, columns


@lru_cache(maxsize=32)
def _block_indices(n_nodes: int) -> Indices:
    """Where the blocks stand in a flattened matrix: diagonal ones, those above and those below them."""
    u = 2 * np.arange(n_nodes)
    left, right = u[:-1], u[1:]
    above = [(left, right), (left, right + 1), (left + 1, right), (left + 1, right + 1)]
    pairs = [(u, u), (u, u + 1), (u + 1, u), (u + 1, u + 1), *above, *((column, row) for row, column in above)]
    return np.concatenate([2 * n_nodes * row + column for row, column in pairs])


def count_modes_below(model: DynamicStiffness, eigenvalue: Floats) -> Indices:
    """Number of natural frequencies below w, shape (n,), for w^2 (w where it spins): the negative pivots of K(w).

    None is missed and double ones count twice. Source: W. H. Wittrick and F. W. Williams, A general algorithm for
    computing natural frequencies of elastic structures, Q. J. Mech. Appl. Math. 24 (1971), with J0 = 0. The pivoting
    of Bunch and Kaufman and rows scaled to one another keep it right where a part of the shaft is at resonance; those
    of links are taken off. Where the shaft spins, the modes of forward whirl are counted for w > 0: phi^T K(w) phi
    falls through 0 once, for any phi.
    """
    counts = [count_modes_of_factor(model, symmetric_factor(matrix)) for matrix in model.scaled(eigenvalue)]
    return np.array(counts, dtype=int)


def count_modes_of_factor(model: DynamicStiffness, factor: SymmetricFactor) -> int:
    """The same from the factor of K(w): its negative pivots but for the two of each link that carries force."""
    return factor.negative - model.link_pivots
