"""Modes of the finite elements that the first terms of the dynamic stiffness are."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from dsm.matrix.dynamic_stiffness import DynamicStiffness
from dsm.modes.newton_step import quadratic

_Float = NDArray[np.float64]

SUPPORT = 1e6
"""A dof held beside a link: stiffness of the spring that stands for it here, over the largest of the shaft."""

MASSLESS = 1e-4
"""Where motions have no mass, all get one, this part of the stiffness over the square of the highest frequency."""


def finite_element_modes(model: DynamicStiffness, count: int) -> tuple[_Float, _Float]:
    """Eigenvalues (count,) of the lowest modes and shapes phi (count, 2 n_nodes), -phi^T K' phi = 1: a start.

    An eigenvalue is w^2, or w where the shaft spins, of forward whirl; K' is the derivative of K by it. Raises
    ArithmeticError where the model has fewer modes.
    """
    basis, springs = _across_links(model)
    if model.spin is None:
        return _at_rest(model, basis, springs, count)
    return _whirling(model, basis, springs, count)


def _across_links(model: DynamicStiffness) -> tuple[_Float, _Float]:
    """Motions (2 n_nodes, n) that are independent, and the stiffness to add for them, diagonal: (n, n).

    Beyond a link it is the motion against the rigid lever that the link is but for its flexibility: the stiffness of
    the link is left to that motion alone, where it drowns nothing. Held dofs do not move; those beyond a link are held
    by a spring.
    """
    link = np.flatnonzero(model.is_link)
    held = model.held.copy()
    held[link] = True
    basis, springs = np.eye(held.size), np.zeros((held.size, held.size))
    held[link + 1] = False
    if link.size:
        stiffest = SUPPORT / np.min(model.scale.reshape(-1, 2)[~model.is_link], axis=0) ** 2
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


def _reduced(model: DynamicStiffness, basis: _Float, power: int) -> _Float:
    """A term of K for the independent motions; forces of links do no work here."""
    moving = np.repeat(~model.is_link, 2)
    return np.asarray(basis[moving].T @ model.term(power)[np.ix_(moving, moving)] @ basis[moving])


def _at_rest(model: DynamicStiffness, basis: _Float, springs: _Float, count: int) -> tuple[_Float, _Float]:
    """Upper bounds, solved for 1/(w^2 + shift): the lowest are the most exact, and a free shaft is no exception."""
    size = basis.shape[1]
    if size < count:
        raise ArithmeticError(f"{count} modes were asked for; the model of this shaft has {size}")
    mass = -_reduced(model, basis, 1)
    shift = 1e-3 * (2 * np.pi * model.top_frequency) ** 2
    shifted = _reduced(model, basis, 0) + springs + shift * mass
    inverse, vectors = eigh(mass, shifted, subset_by_index=[size - count, size - 1])
    shape = (basis @ (vectors / np.sqrt(inverse))).T[::-1]
    return np.maximum(1 / inverse[::-1] - shift, 0.0), shape


def _whirling(model: DynamicStiffness, basis: _Float, springs: _Float, count: int) -> tuple[_Float, _Float]:
    """The same for a shaft that spins, from terms 0 to 2: K0 + w K1 - w^2 M.

    With y = w phi it is diag(K0, M) z = w [[-K1, M], [M, 0]] z, z = (phi, y), whose left side is positive definite.
    """
    stiffness, gyroscopic, mass = (_reduced(model, basis, power) for power in range(3))
    stiffness, mass = stiffness + springs, -mass
    if np.any(model.is_link):  # their far ends have no mass of their own here
        mass = mass + MASSLESS / (2 * np.pi * model.top_frequency) ** 2 * stiffness
    zero = np.zeros_like(mass)
    right = np.block([[-gyroscopic, mass], [mass, zero]])
    last = 2 * basis.shape[1] - 1
    inverse, vectors = eigh(
        right, np.block([[stiffness, zero], [zero, mass]]), subset_by_index=[last - count + 1, last]
    )
    if inverse[0] <= 0:
        raise ArithmeticError(f"{count} modes were asked for; the model of this shaft has fewer")
    shape = (basis @ vectors[: basis.shape[1]]).T[::-1]
    eigenvalue = 1 / inverse[::-1]
    size = -quadratic(model.dense(eigenvalue, derivative=True), shape)
    return eigenvalue, shape / np.sqrt(size)[:, np.newaxis]
