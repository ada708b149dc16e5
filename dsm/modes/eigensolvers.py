"""Finite-element start values and Newton iteration for modes."""

from collections.abc import Callable
from typing import TypeVar

import numpy as np
import scipy
from numpy.typing import NDArray

from dsm.arrays import Floats
from dsm.matrix.dynamic_stiffness import DynamicStiffness

Number = TypeVar("Number", np.float64, np.complex128)


def newton_step(
    trial: NDArray[Number],
    matrix: NDArray[Number],
    slope: NDArray[Number],
    shape: NDArray[Number],
    solve: Callable[..., NDArray[Number]],
) -> tuple[NDArray[Number], NDArray[Number], NDArray[Number]]:
    """Return better solutions of K(s) phi = 0, all modes at once, shape (n,): s, phi (n, n_dofs) and phi^T K' phi (n,).

    matrix, slope: K and its derivative K' at `trial` (n,), near the wanted s, where K can be inverted: shape
    (n, n_dofs, n_dofs). The shape becomes K^-1 K' phi, and s the zero of Rayleigh's quotient phi^T K(s) phi, to first
    order in s; its error is that of the shape squared. solve: returns y of K y = right.
    """
    moved = solve(matrix, slope @ shape[..., np.newaxis])[..., 0]
    energy = quadratic_form(slope, moved)
    return trial - quadratic_form(matrix, moved) / energy, moved, energy


def quadratic_form(matrix: NDArray[Number], shape: NDArray[Number]) -> NDArray[Number]:
    """Return phi^T A phi of each mode, shape (n,)."""
    return np.asarray(np.sum(shape * (matrix @ shape[..., np.newaxis])[..., 0], axis=1))


LINK_SUPPORT_RATIO = 1e6
"""Stiffness of the spring that replaces a held dof beyond a link, over the largest of the shaft."""


def finite_element_modes(model: DynamicStiffness, count: int) -> tuple[Floats, Floats]:
    """Return w^2 (count,) of the lowest modes without rotation and shapes phi (count, 2 n_nodes), phi^T M phi = 1.

    The frequencies are upper bounds. Solved for 1/(w^2 + shift): the lowest are the most exact, and a free shaft is no
    exception. Raises ArithmeticError if the model has fewer modes.
    """
    basis, springs = _independent_motions(model)
    size = basis.shape[1]
    if size < count:
        raise ArithmeticError(f"the shaft model has only {size} modes, not {count}")
    mass = -_reduced_term(model, basis, 1 if model.spin is None else 2)
    shift = 1e-3 * (2 * np.pi * model.top_frequency) ** 2
    shifted = _reduced_term(model, basis, 0) + springs + shift * mass
    inverse, vectors = scipy.linalg.eigh(mass, shifted, subset_by_index=[size - count, size - 1])
    shape = (basis @ (vectors / np.sqrt(inverse))).T[::-1]
    return np.maximum(1 / inverse[::-1] - shift, 0.0), shape


def whirling_modes(model: DynamicStiffness, w2: Floats, shape: Floats, count: int) -> tuple[Floats, Floats]:
    """Return start values w (count,) of the lowest modes of forward whirl and shapes phi, -phi^T K' phi = 1.

    Combines the modes above, of the same nodes: K0 + w K1 - w^2 M has K0 = diag(w2) and M = I for them. With
    y = w z it is diag(K0, I) (z, y) = w [[-K1, I], [I, 0]] (z, y), whose left side is positive definite. Raises
    LinAlgError if it is not.
    """
    if np.any(w2 <= 0):
        raise np.linalg.LinAlgError("the shaft has no support. Give at least two bearings.")
    gyroscopic = _reduced_term(model, shape.T, 1)
    n, still = w2.size, np.sqrt(w2)
    scaled = np.zeros((2 * n, 2 * n))
    scaled[:n, :n] = -gyroscopic / np.outer(still, still)
    scaled[:n, n:] = scaled[n:, :n] = np.diag(1 / still)
    inverse, vectors = np.linalg.eigh(scaled)
    last = slice(-1, -count - 1, -1)
    w, shapes = 1 / inverse[last], (vectors[:n, last] / still[:, np.newaxis]).T @ shape
    size = -quadratic_form(model.dense(w, derivative=True), shapes)
    return w, shapes / np.sqrt(size)[:, np.newaxis]


def _independent_motions(model: DynamicStiffness) -> tuple[Floats, Floats]:
    """Return independent motions (2 n_nodes, n), and the diagonal stiffness to be added for them: (n, n).

    Beyond a link the motion is that against the rigid lever of the link: the stiffness of
    the link belongs to that motion alone, where it hides nothing. Held dofs do not move; those beyond a link are held
    by a spring.
    """
    link = np.flatnonzero(model.is_link)
    held = model.held.copy()
    held[link] = True
    basis, springs = np.eye(held.size), np.zeros((held.size, held.size))
    held[link + 1] = False
    if link.size:
        stiffest = LINK_SUPPORT_RATIO / np.min(model.scale.reshape(-1, 2)[~model.is_link], axis=0) ** 2
        flexibility, lever = -model.diagonal[:, link, 0], -model.coupling[:, link - 1, 0]
        for index, node in enumerate(link):
            far, near, force = (slice(2 * n, 2 * n + 2) for n in (node + 1, node - 1, node))
            inverted = np.linalg.inv(flexibility[[[0, 1], [1, 2]], index])
            springs[far, far] = inverted
            basis[force, far] = inverted
            basis[far] += lever[:, index].reshape(2, 2).T @ basis[near]
        for node, dof in np.argwhere(model.held):
            if not held[node, dof]:
                row = basis[2 * node + dof]
                springs += stiffest[dof] * np.outer(row, row)
    free = np.flatnonzero(~held.ravel())
    return basis[:, free], springs[np.ix_(free, free)]


def _reduced_term(model: DynamicStiffness, basis: Floats, power: int) -> Floats:
    """Return a term of K for the independent motions; forces of links do no work here."""
    moving = np.repeat(~model.is_link, 2)
    return np.asarray(basis[moving].T @ model.term(power)[np.ix_(moving, moving)] @ basis[moving])
