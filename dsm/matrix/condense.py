"""Condense a shaft to the stiffness at one node, with or without damping."""

import math
from typing import NamedTuple

import numpy as np

from dsm.arrays import Complexes, Flags, Floats
from dsm.matrix.dynamic_stiffness import DynamicStiffness
from dsm.spindle.attachments import Damping, damping_of_bearings, supports
from dsm.spindle.spindle import Spindle


class CondensedStiffness(NamedTuple):
    """Stiffness of a whole shaft against deflection u and slope t of one node; (n,) each, n frequencies."""

    uu: Complexes
    """Force over deflection (N/m)."""
    ut: Complexes
    """Force over slope (N), and moment over deflection."""
    tt: Complexes
    """Moment over slope (N m)."""
    share_u: Complexes
    """Deflection of the node `start` over u (-)."""
    share_t: Complexes
    """Deflection of the node `start` over t (m)."""


_Elimination = tuple[Complexes, tuple[Complexes, ...]]
"""Effect of the nodes before one.

Values of uu, ut, tt to be subtracted from its stiffness, shape (3, n), and the motion of the node before over its own,
with changed sign: u/u, u/t, t/u, t/t.
"""


def condense_to_node(
    diagonal: Complexes, coupling: Complexes, is_link: Flags, node: int, start: int | None = None
) -> CondensedStiffness:
    """Eliminate all nodes but one, from both ends, all frequencies at once.

    diagonal, coupling: blocks of K as in DynamicStiffness.blocks. is_link: nodes of force and moment;
    each is eliminated together with the node before it, which alone may be free to move (a tip). start: a node
    not beyond `node` whose deflection is returned; None: the node itself.
    """
    diagonal, coupling = diagonal.swapaxes(0, 1), coupling.swapaxes(0, 1)
    begin = node if start is None else start
    left, share_u, share_t = _eliminate(diagonal[:node], coupling[:node], is_link[:node], begin)
    # From the far end down to the node, where the two sides of a coupling block change places.
    flipped = coupling[: node - diagonal.shape[0] : -1][:, [0, 2, 1, 3]]
    right, _, _ = _eliminate(diagonal[:node:-1], flipped, is_link[:node:-1], flipped.shape[0])
    uu, ut, tt = diagonal[node] - left - right
    return CondensedStiffness(uu, ut, tt, share_u, share_t)


def _eliminate(
    diagonal: Complexes, coupling: Complexes, is_link: Flags, start: int
) -> tuple[Complexes, Complexes, Complexes]:
    """Return the stiffness that the last node takes from the next one, and the deflection of node `start`."""
    lost = np.zeros((3, diagonal.shape[2]), dtype=np.complex128)
    share_u, share_t = lost[0] + 1, lost[0]
    for number in np.flatnonzero(~is_link):
        pivot = diagonal[number] - lost
        if number + 1 < is_link.size and is_link[number + 1]:
            passed = _across_link(pivot, coupling[number], diagonal[number + 1], coupling[number + 1])
        else:
            passed = _across_element(pivot, coupling[number])
        lost, (u_u, u_t, t_u, t_t) = passed
        if number >= start:
            share_u, share_t = -(share_u * u_u + share_t * t_u), -(share_u * u_t + share_t * t_t)
    return lost, share_u, share_t


def _across_element(pivot: Complexes, coupling: Complexes) -> _Elimination:
    a, b, d = pivot
    c_uu, c_ut, c_tu, c_tt = coupling
    determinant = a * d - b * b
    u_u, u_t = (d * c_uu - b * c_tu) / determinant, (d * c_ut - b * c_tt) / determinant
    t_u, t_t = (a * c_tu - b * c_uu) / determinant, (a * c_tt - b * c_ut) / determinant
    lost = c_uu * u_u + c_tu * t_u, c_uu * u_t + c_tu * t_t, c_ut * u_t + c_tt * t_t
    return np.array(lost), (u_u, u_t, t_u, t_t)


def _across_link(pivot: Complexes, near: Complexes, force: Complexes, far: Complexes) -> _Elimination:
    """Solve [A C; C^T D] [q; p] = [0; C2] for each frequency; A may be singular, as at a free tip."""
    a, b, d = pivot
    lower = [near[0], near[2], force[0], force[1]], [near[1], near[3], force[1], force[2]]
    both = np.array([[a, b, near[0], near[1]], [b, d, near[2], near[3]], *lower])
    zero = np.zeros_like(a)
    right = np.array([[zero, zero], [zero, zero], [far[0], far[1]], [far[2], far[3]]])
    solved = np.linalg.solve(both.transpose(2, 0, 1), right.transpose(2, 0, 1)).transpose(1, 2, 0)
    (u_u, u_t), (t_u, t_t), (q_u, q_t), (m_u, m_t) = solved
    lost = far[0] * q_u + far[2] * m_u, far[0] * q_t + far[2] * m_t, far[1] * q_t + far[3] * m_t
    return np.array(lost), (u_u, u_t, t_u, t_t)


def damped_blocks(
    model: DynamicStiffness, spindle: Spindle, w: Complexes, damping: Damping, derivative: bool = False
) -> tuple[Complexes, Complexes]:
    """Return the blocks of K(w) with damping, for a shaft without rotation at complex w (rad/s), shape (n,).

    Shaft, bearings, housing and joints have the complex stiffness k (1 + i eta). Each bearing also has its viscous
    damper, i w c parallel to its spring, before the housing, taken from `damping`, not from the spindle.
    With `derivative`, the blocks of dK/dw.
    """
    complexity = damping.complexity
    w2 = np.asarray(w * w / complexity)
    diagonal, coupling = model.blocks(w2, derivative)
    factor = 2 * w if derivative else np.full(1, complexity)
    diagonal, coupling = factor * diagonal, factor * coupling
    damped = [i for i, b in enumerate(spindle.bearings) if damping.viscous[i] > 0 and math.isfinite(b.stiffness)]
    if damped:
        bearings, viscous = [spindle.bearings[i] for i in damped], damping.viscous[damped]
        held = supports(bearings, w, Damping(viscous, damping.loss_factor))
        node = [model.node(bearing.position) for bearing in bearings]
        undamped = complexity * np.array([bearing.support_stiffness for bearing in bearings])
        change = 1j * viscous * held.stiffness_slope if derivative else held.stiffness - undamped
        diagonal[0, node] += change.T
    return diagonal, coupling


CONDENSATION_CHUNK = 1024
"""Frequencies whose blocks are in memory at a time: 2 MB for 30 nodes, and faster than all at once."""


def condense_damped(
    model: DynamicStiffness,
    spindle: Spindle,
    frequency: Floats,
    loss_factor: float,
    node: int,
    start: int | None = None,
    extra: Complexes | None = None,
) -> CondensedStiffness:
    """Condense a shaft without rotation dynamically to one node, exact at each frequency (Hz), shape (n,).

    loss_factor: of all stiffness, see Damping; ValueError below 0. node and start: as for condense_to_node. extra:
    stiffness uu, ut, tt to be added at the last node, shape (3, n).
    """
    damping = damping_of_bearings(spindle.bearings, loss_factor)
    w = np.asarray(2 * np.pi * frequency, dtype=np.complex128)
    condensed = np.empty((5, w.size), dtype=np.complex128)
    for first in range(0, w.size, CONDENSATION_CHUNK):
        chunk = slice(first, first + CONDENSATION_CHUNK)
        diagonal, coupling = damped_blocks(model, spindle, w[chunk], damping)
        if extra is not None:
            diagonal[:, -1] += extra[:, chunk]
        condensed[:, chunk] = condense_to_node(diagonal, coupling, model.is_link, node, start)
    return CondensedStiffness(*condensed)
