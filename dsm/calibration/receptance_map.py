"""Receptance for many bearing stiffnesses at once."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from dsm.arrays import Complexes, check_numbers
from dsm.calibration.stiffness_groups import calibrated_bearings
from dsm.matrix.assemble import assemble
from dsm.matrix.condense import damped_blocks
from dsm.matrix.dynamic_stiffness import check_frequencies, full_matrices
from dsm.spindle.attachments import Bearing, damping_of_bearings, supports
from dsm.spindle.spindle import Spindle, require_support

RECEPTANCE_MAP_CHUNK = 50
"""Frequencies whose full matrices are in memory at a time."""


def receptance_map(
    spindle: Spindle,
    frequency: ArrayLike,
    factor: ArrayLike,
    position: float = 0.0,
    loss_factor: float = 0.0,
    group: str | None = None,
) -> Complexes:
    """Compute the receptance for bearing stiffnesses times each of several factors.

    One eigenproblem of the order of the number of bearings per frequency. At one factor f0 let H0 be the receptance, S
    the compliance across the springs and e their elongation under a unit force, both weighted with the roots of the
    spring stiffnesses. With S = V diag(s) V^-1 and d = (1 + i eta)(f/f0 - 1), Woodbury's formula is
    H = H0 - sum over i of p_i d/(1 + d s_i), p = (V^T e)(V^-1 e).

    Parameters
    ----------
    spindle : Spindle
        Spindle with dampers.
    frequency : array_like, shape (n_frequencies,)
        Frequencies (Hz).
    factor : array_like, shape (n_factors,)
        Factors on the bearing springs (-), > 0; dampers and housings are unchanged.
    position : float
        Distance from the tool tip (m).
    loss_factor : float
        Loss factor eta (-), as for receptance.
    group : str, optional
        Group of bearings. Default: all bearings with a group.

    Returns
    -------
    ndarray of complex, shape (n_factors, n_frequencies)
        Deflection over force (m/N).

    Raises
    ------
    ValueError
        As receptance, for factors not finite and > 0, and a group with no bearing or a rigid one.

    Examples
    --------
    >>> spindle = Spindle([Segment(0.4, 0.05)], [Bearing(0.1, 2e8), Bearing(0.35, 1e8)])
    >>> softer = receptance_map(spindle, np.arange(1.0, 1500.0), [1.0, 0.8, 0.6], loss_factor=0.04)
    >>> softer.shape
    (3, 1499)
    >>> (abs(softer).argmax(axis=1) + 1).tolist()  # Hz: peak at the tip as the bearings wear
    [1124, 1019, 896]
    """
    f = check_frequencies(frequency)
    factors = check_numbers("factor", np.atleast_1d(factor), "", " of at least one factor", least=1, positive=True)
    if np.any(f == 0):
        require_support(spindle)
    chosen = calibrated_bearings(spindle, group)
    middle = float(np.sqrt(np.min(factors) * np.max(factors)))
    bearings = [replace(spindle.bearings[i], stiffness=middle * spindle.bearings[i].stiffness) for i in chosen]
    kept = [bearing for index, bearing in enumerate(spindle.bearings) if index not in chosen]
    w = np.asarray(2 * np.pi * f, dtype=np.complex128)
    places = [position, *(bearing.position for bearing in bearings)]
    compliance = _compliance(replace(spindle, bearings=[*bearings, *kept]), w, places, loss_factor)
    values, products = _spring_terms(bearings, compliance, w, loss_factor)
    change = (1 + 1j * loss_factor) * (factors[:, np.newaxis] / middle - 1)
    receptances = np.tile(compliance[:, 0, 0], (factors.size, 1))
    for value, product in zip(values.T, products.T, strict=True):
        receptances -= product * change / (1 + change * value)
    return receptances


def _compliance(spindle: Spindle, w: Complexes, places: Sequence[float], loss_factor: float) -> Complexes:
    """Return the deflections under forces, both at `places` (m), shape (n, n_places, n_places)."""
    damping = damping_of_bearings(spindle.bearings, loss_factor)
    model = assemble(spindle, float(np.max(w.real, initial=0.0)) / (2 * np.pi), places)
    dofs = [2 * model.node(place) for place in places]
    forces = np.zeros((model.held.size, len(dofs)), dtype=np.complex128)
    forces[dofs, np.arange(len(dofs))] = ~model.held.ravel()[dofs]
    compliance = np.empty((w.size, len(dofs), len(dofs)), dtype=np.complex128)
    for start in range(0, w.size, RECEPTANCE_MAP_CHUNK):
        chunk = slice(start, start + RECEPTANCE_MAP_CHUNK)
        matrices = full_matrices(*damped_blocks(model, spindle, w[chunk], damping))
        compliance[chunk] = model.solve(matrices, forces)[:, dofs]
    return compliance


def _spring_terms(
    bearings: Sequence[Bearing], compliance: Complexes, w: Complexes, loss_factor: float
) -> tuple[Complexes, Complexes]:
    """Return s and p of the formula above, shape (n, n_bearings) each."""
    held = supports(bearings, w, damping_of_bearings(bearings, loss_factor))
    root = np.sqrt([bearing.stiffness for bearing in bearings])
    matrix = np.outer(root, root) * held.across(compliance[:, 1:, 1:])
    values, vectors = np.linalg.eig(matrix)
    elongation = (root * held.motion_share * compliance[:, 1:, 0])[..., np.newaxis]
    products = (vectors.swapaxes(1, 2) @ elongation) * np.linalg.solve(vectors, elongation)
    return values, products[..., 0]
