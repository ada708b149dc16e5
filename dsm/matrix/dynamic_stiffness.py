"""Dynamic stiffness matrix of a whole shaft, its factor, and the count of modes below a frequency."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple, TypeVar

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from dsm.arrays import Flags, Floats, Indices, check_numbers
from dsm.spindle.attachments import Bearing, Joint
from dsm.spindle.segment import nearest_index, nearest_indices


def check_frequencies(frequency: ArrayLike, positive: bool = False) -> Floats:
    """Return frequencies (Hz) as an array of shape (n,), one number as (1,); ValueError unless finite and >= 0.

    ValueError for 0, too, if `positive`.
    """
    f = check_numbers("frequency", np.atleast_1d(frequency), " Hz", " (Hz)")
    if positive and np.any(f == 0):
        raise ValueError("frequency=0 Hz is not > 0")
    return f


class SymmetricFactor(NamedTuple):
    """Factor L D L^T with the pivoting of Bunch and Kaufman, in the format of LAPACK."""

    values: Floats
    """Entries of L, and of D in 1 x 1 and 2 x 2 blocks."""
    pivots: NDArray[np.int32]
    """Row exchanges; negative ones belong to 2 x 2 blocks, which have one negative eigenvalue each."""
    link_pivots: int
    """Number of negative eigenvalues that belong to links."""

    @property
    def modes_below(self) -> int:
        """Number of modes below w, of K(w): its negative eigenvalues (Sylvester's law) without those of links."""
        single = self.pivots > 0
        pairs = (self.pivots.size - np.count_nonzero(single)) // 2
        return int(np.count_nonzero(self.values.diagonal()[single] < 0) + pairs) - self.link_pivots

    def solve(self, right: Floats) -> Floats:
        """Solve matrix times y = right, shape (n, m)."""
        return np.asarray(scipy.linalg.lapack.dsytrs(self.values, self.pivots, right, lower=1)[0])


Number = TypeVar("Number", np.float64, np.complex128)


@dataclass(frozen=True, eq=False)
class DynamicStiffness:
    """Stiffness matrix K of a chain of beam elements, a polynomial in w^2 (w the angular frequency, rad/s).

    For a spinning shaft it is a polynomial in w, for the circular whirl u exp(i w t) of both planes together. The
    eigenvalue below is w^2, or w for a spinning shaft. Lumped masses, bearings and joints of no length are included.
    Node i has the deflection u_i and the slope t_i = du/dz, in this order. Between two nodes that are very near to each
    other, or on both sides of a joint, is a node of force and moment: a link, with flexibility instead
    of stiffness, whose rounding would hide all else (link_elements). A held dof has its row and column
    replaced by those of the unit matrix: it stays at zero and adds a positive pivot; a link adds two negative ones.
    Exact for w up to that of `top_frequency`, where no element has a clamped natural frequency of its own (J0 = 0 of
    Wittrick and Williams).
    """

    position: Floats
    """Nodes from the tool tip on (m), shape (n_nodes,); inf for nodes of force and moment."""
    diagonal: Floats
    """Coefficients of K(u_i, u_i), K(u_i, t_i), K(t_i, t_i) in powers of the eigenvalue, (3, n_nodes, n_terms)."""
    coupling: Floats
    """Coefficients of K(u_i, u_j), K(u_i, t_j), K(t_i, u_j), K(t_i, t_j), j = i + 1, (4, n_nodes - 1, n_terms)."""
    held: Flags
    """Fixed dofs, shape (n_nodes, 2)."""
    scale: Floats
    """Scale factors of rows and columns of a full matrix, shape (2 n_nodes,)."""
    top_frequency: float
    """Highest frequency of interest (Hz)."""
    spin: float | None = None
    """Speed of rotation (rad/s); forward whirl has its sense. None: the polynomial is one in w^2."""

    @property
    def is_link(self) -> Flags:
        """Which nodes are nodes of force and moment, shape (n_nodes,)."""
        return np.isinf(self.position)

    @cached_property
    def link_pivots(self) -> int:
        """Number of negative pivots of links: two each, except for forces that are held at zero."""
        return int(np.count_nonzero(~self.held[self.is_link]))

    def to_eigenvalue(self, frequency: Floats) -> Floats:
        """Convert frequencies (Hz), any shape, to the variable of the polynomial."""
        w = 2 * np.pi * frequency
        return np.asarray(w if self.spin is not None else w * w)

    def to_frequency(self, eigenvalue: Floats) -> Floats:
        """Convert the variable of the polynomial, any shape, to frequencies (Hz)."""
        return np.asarray((eigenvalue if self.spin is not None else np.sqrt(eigenvalue)) / (2 * np.pi))

    def node(self, position: float) -> int:
        """Return the index of the node nearest to a position (m)."""
        return nearest_index(self.position, position)

    def dofs(self, parts: Sequence[Bearing | Joint]) -> Indices:
        """Return the indices of the deflections at parts in a full matrix, shape (n,)."""
        return 2 * nearest_indices(self.position, [part.position for part in parts])

    def blocks(self, eigenvalue: NDArray[Number], derivative: bool = False) -> tuple[NDArray[Number], NDArray[Number]]:
        """Return diagonal (3, n_nodes, n) and coupling (4, n_nodes - 1, n), in SI units, at eigenvalues (n,).

        Eigenvalues may be complex or negative. With `derivative`, the derivatives by the eigenvalue.
        """
        powers = self._powers(eigenvalue, derivative)
        return self.diagonal @ powers, self.coupling @ powers

    def dense(self, eigenvalue: NDArray[Number], derivative: bool = False) -> NDArray[Number]:
        """Return K, or its derivative by the eigenvalue, as full matrices of shape (n, 2 n_nodes, 2 n_nodes)."""
        return full_matrices(*self.blocks(eigenvalue, derivative))

    def factors(self, eigenvalue: Floats) -> list[SymmetricFactor]:
        """Return the factor of K, scaled, at each eigenvalue."""
        place, coefficients = self._lower
        matrices = np.zeros((eigenvalue.size, self.scale.size**2))
        matrices[:, place] = (coefficients @ self._powers(eigenvalue)).T
        lower_halves = (matrix.reshape(self.scale.size, -1).T for matrix in matrices)  # in Fortran order
        factors = (scipy.linalg.lapack.dsytrf(matrix, lower=1, overwrite_a=1)[:2] for matrix in lower_halves)
        return [SymmetricFactor(values, pivots, self.link_pivots) for values, pivots in factors]

    def slope_of(self, eigenvalue: Floats, shape: Floats) -> Floats:
        """Return phi^T K' phi at each eigenvalue (n,), K' its derivative, of a motion phi = `scale` times shape."""
        place, coefficients = self._lower
        column, row = np.divmod(place, self.scale.size)
        twice = np.where(row == column, 1.0, 2.0) * shape[row] * shape[column]
        return np.asarray((twice @ coefficients) @ self._powers(eigenvalue, derivative=True))

    @cached_property
    def _lower(self) -> tuple[Indices, Floats]:
        """Indices in the flattened matrix, column by column, and scaled coefficients of its lower half."""
        rows, columns = _lower_half(self.position.size)
        terms = self.diagonal.shape[2]
        coefficients = np.concatenate([self.diagonal.reshape(-1, terms), self.coupling.reshape(-1, terms)])
        coefficients *= (self.scale[rows] * self.scale[columns])[:, np.newaxis]
        return columns * self.scale.size + rows, coefficients

    def _powers(self, eigenvalue: NDArray[Number], derivative: bool = False) -> NDArray[Number]:
        """Return powers of each eigenvalue, or their derivatives, shape (n_terms, n)."""
        powers = np.empty((self.diagonal.shape[2], eigenvalue.size), dtype=eigenvalue.dtype)
        powers[0], powers[1:] = 1.0, eigenvalue
        np.multiply.accumulate(powers, out=powers)
        if derivative:
            powers[1:] = np.arange(1, powers.shape[0])[:, np.newaxis] * powers[:-1]
            powers[0] = 0.0
        return powers

    def solve(self, matrices: NDArray[Number], right: NDArray[Number]) -> NDArray[Number]:
        """Solve full matrices times y = right, shape (n, 2 n_nodes, m), with scaled rows and columns."""
        scale = self.scale[:, np.newaxis]
        solution = np.linalg.solve(matrices * (scale * self.scale), scale * right)
        return np.asarray(scale * solution, dtype=matrices.dtype)

    def solve_singular(self, matrices: NDArray[Number], right: NDArray[Number]) -> NDArray[Number]:
        """Solve nearly singular matrices times y = right for inverse iteration.

        Peters and Wilkinson, SIAM Review 21 (1979): a pivot of zero may be replaced by one of rounding size.
        """
        try:
            return self.solve(matrices, right)
        except np.linalg.LinAlgError:
            rounding = np.diag(np.finfo(np.float64).eps / self.scale**2)
            return self.solve(np.asarray(matrices + rounding, dtype=matrices.dtype), right)

    def term(self, power: int) -> Floats:
        """Return the coefficient of one power of the eigenvalue in K, a full matrix of shape (2 n_nodes, 2 n_nodes)."""
        return np.asarray(full_matrices(self.diagonal[..., [power]], self.coupling[..., [power]])[0])


def full_matrices(diagonal: NDArray[Number], coupling: NDArray[Number]) -> NDArray[Number]:
    """Return full matrices, shape (n, 2 n_nodes, 2 n_nodes), of blocks as in DynamicStiffness.blocks."""
    size = 2 * diagonal.shape[1]
    rows, columns = _lower_half(diagonal.shape[1])
    values = np.concatenate([*diagonal, *coupling]).T
    matrices = np.zeros((values.shape[0], size * size), dtype=diagonal.dtype)
    matrices[:, size * rows + columns] = matrices[:, size * columns + rows] = values
    return matrices.reshape(-1, size, size)


@lru_cache(maxsize=32)
def _lower_half(n_nodes: int) -> tuple[Indices, Indices]:
    """Return rows and columns of the blocks on and below the diagonal, in the order of diagonal and coupling."""
    u = 2 * np.arange(n_nodes)
    left, right = u[:-1], u[1:]
    pairs = [(u, u), (u + 1, u), (u + 1, u + 1)]
    pairs += [(right, left), (right + 1, left), (right, left + 1), (right + 1, left + 1)]
    rows, columns = (np.concatenate(part) for part in zip(*pairs, strict=True))
    return rows, columns


def count_modes_below(model: DynamicStiffness, eigenvalue: Floats) -> Indices:
    """Count the natural frequencies below w, shape (n,), for w^2 (w if spinning): the negative pivots of K(w).

    None is missed and double ones count twice. Source: W. H. Wittrick and F. W. Williams, A general algorithm for
    computing natural frequencies of elastic structures, Q. J. Mech. Appl. Math. 24 (1971), with J0 = 0. The pivoting
    of Bunch and Kaufman and scaled rows keep it right if a part of the shaft is at resonance; the pivots
    of links are subtracted. For a spinning shaft, the modes of forward whirl are counted for w > 0: phi^T K(w) phi
    falls through 0 once, for any phi.
    """
    return np.array([factor.modes_below for factor in model.factors(eigenvalue)], dtype=int)
