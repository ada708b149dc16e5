"""The dynamic stiffness matrix of a whole shaft."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from dsm.spindle.places import nearest

Number = TypeVar("Number", np.float64, np.complex128)


@dataclass(frozen=True, eq=False)
class DynamicStiffness:
    """Stiffness matrix K of a chain of beam elements, a polynomial in w^2 (w the angular frequency, rad/s).

    For a shaft that spins it is a polynomial in w, for the circular whirl u exp(i w t) of both planes together. What
    is called `x` below is w^2, or w where it spins. Lumped masses, bearings and joints of no length are in it.
    Node i has the deflection u_i and the slope t_i = du/dz, in this order. Between two nodes that are very near to each
    other, or on both sides of a joint, stands a node of force and moment instead: a link, with its flexibility in place
    of its stiffness, whose rounding would drown all else (link_elements). A dof that is held has its row and column
    replaced by those of the unit matrix: it stays at zero and adds a positive pivot; a link adds two negative ones.
    Exact for w up to that of `top_frequency`, where no element has a clamped natural frequency of its own (J0 = 0 of
    Wittrick and Williams).
    """

    position: NDArray[np.float64]
    """Nodes from the tool tip on (m), shape (n_nodes,); inf for those of force and moment."""
    diagonal: NDArray[np.float64]
    """Coefficients of K(u_i, u_i), K(u_i, t_i), K(t_i, t_i) in powers of x, shape (3, n_nodes, n_terms)."""
    coupling: NDArray[np.float64]
    """The same of K(u_i, u_j), K(u_i, t_j), K(t_i, u_j), K(t_i, t_j), j = i + 1, shape (4, n_nodes - 1, n_terms)."""
    held: NDArray[np.bool_]
    """Dofs that cannot move, shape (n_nodes, 2)."""
    scale: NDArray[np.float64]
    """What rows and columns of a full matrix are multiplied by to be of one size, shape (2 n_nodes,)."""
    top_frequency: float
    """Highest frequency of interest (Hz)."""
    spin: float | None = None
    """Speed of rotation (rad/s); forward whirl turns with it. None: the polynomial is one in w^2."""

    @property
    def is_link(self) -> NDArray[np.bool_]:
        """Which nodes are those of force and moment, shape (n_nodes,)."""
        return np.isinf(self.position)

    def to_x(self, frequency: NDArray[np.float64]) -> NDArray[np.float64]:
        """The variable of the polynomial at frequencies (Hz), any shape."""
        w = 2 * np.pi * frequency
        return np.asarray(w if self.spin is not None else w * w)

    def to_frequency(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Frequencies (Hz) at values of the variable, any shape."""
        return np.asarray((x if self.spin is not None else np.sqrt(x)) / (2 * np.pi))

    def node(self, position: float) -> int:
        """Index of the node nearest to a position (m)."""
        return nearest(self.position, position)

    def blocks(self, x: NDArray[Number], derivative: bool = False) -> tuple[NDArray[Number], NDArray[Number]]:
        """Values of diagonal (3, n_nodes, n) and coupling (4, n_nodes - 1, n) at x, shape (n,), in SI units.

        x may be complex or negative. With `derivative`, those of dK/dx.
        """
        powers = np.vander(x, self.diagonal.shape[2], increasing=True).T
        if derivative:
            order = np.arange(1, powers.shape[0])
            powers = order[:, np.newaxis] * powers[:-1]
            return self.diagonal[..., 1:] @ powers, self.coupling[..., 1:] @ powers
        return self.diagonal @ powers, self.coupling @ powers

    def dense(self, x: NDArray[Number], derivative: bool = False) -> NDArray[Number]:
        """K, or dK/dx, as full matrices of shape (n, 2 n_nodes, 2 n_nodes)."""
        return full_matrices(*self.blocks(x, derivative))

    def solve(self, matrices: NDArray[Number], right: NDArray[Number]) -> NDArray[Number]:
        """Solutions of full matrices times y = right, shape (n, 2 n_nodes, m), rows and columns made of one size."""
        scale = self.scale[:, np.newaxis]
        found = np.linalg.solve(matrices * (scale * self.scale), scale * right)
        return np.asarray(scale * found, dtype=matrices.dtype)

    def term(self, power: int) -> NDArray[np.float64]:
        """Coefficient of one power of x in K, a full matrix of shape (2 n_nodes, 2 n_nodes)."""
        return np.asarray(
            full_matrices(self.diagonal[..., power : power + 1], self.coupling[..., power : power + 1])[0]
        )


def full_matrices(diagonal: NDArray[Number], coupling: NDArray[Number]) -> NDArray[Number]:
    """Full matrices, shape (n, 2 n_nodes, 2 n_nodes), of blocks as in DynamicStiffness.blocks."""
    uu, ut, tt = diagonal
    size = 2 * uu.shape[0]
    matrices = np.zeros((uu.shape[1], size * size), dtype=uu.dtype)
    matrices[:, _entries(uu.shape[0])] = np.concatenate([uu, ut, ut, tt, *coupling, *coupling]).T
    return matrices.reshape(-1, size, size)


@lru_cache(maxsize=32)
def _entries(n_nodes: int) -> NDArray[np.int_]:
    """Where the blocks stand in a flattened matrix: diagonal ones, those above and those below them."""
    u = 2 * np.arange(n_nodes)
    left, right = u[:-1], u[1:]
    above = [(left, right), (left, right + 1), (left + 1, right), (left + 1, right + 1)]
    pairs = [(u, u), (u, u + 1), (u + 1, u), (u + 1, u + 1), *above, *((column, row) for row, column in above)]
    return np.concatenate([2 * n_nodes * row + column for row, column in pairs])
