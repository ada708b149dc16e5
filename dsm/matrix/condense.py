"""Block elimination along the shaft: the stiffness at one node."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_Complex = NDArray[np.complex128]


class Condensed(NamedTuple):
    """What a whole shaft opposes to deflection u and slope t of one node; (n,) each, n frequencies."""

    uu: _Complex
    """Force over deflection (N/m)."""
    ut: _Complex
    """Force over slope (N), and moment over deflection."""
    tt: _Complex
    """Moment over slope (N m)."""
    share_u: _Complex
    """Deflection of the node `start` over u (-)."""
    share_t: _Complex
    """Deflection of the node `start` over t (m)."""


def condense(diagonal: _Complex, coupling: _Complex, node: int, start: int | None = None) -> Condensed:
    """Eliminate all nodes but one, from both ends, all frequencies at once.

    diagonal, coupling: blocks of K as in DynamicStiffness.blocks. start: a node not beyond `node` whose deflection is
    carried along; None: the node itself.
    """
    diagonal, coupling = diagonal.swapaxes(0, 1), coupling.swapaxes(0, 1)
    begin = node if start is None else start
    left, share_u, share_t = _eliminate(diagonal[:node], coupling[:node], begin)
    # From the far end down to the node, where the two sides of a coupling block change places.
    flipped = coupling[: node - diagonal.shape[0] : -1][:, [0, 2, 1, 3]]
    right, _, _ = _eliminate(diagonal[:node:-1], flipped, flipped.shape[0])
    uu, ut, tt = diagonal[node]
    return Condensed(uu - left[0] - right[0], ut - left[1] - right[1], tt - left[2] - right[2], share_u, share_t)


def _eliminate(
    diagonal: Iterable[_Complex], coupling: Iterable[_Complex], start: int
) -> tuple[tuple[_Complex, _Complex, _Complex], _Complex, _Complex]:
    """What the last of the nodes takes from the stiffness of the next; with it, the deflection of node `start`."""
    nothing = np.zeros(1, dtype=np.complex128)
    lost = nothing, nothing, nothing
    share_u, share_t = nothing + 1, nothing
    for number, ((uu, ut, tt), (c_uu, c_ut, c_tu, c_tt)) in enumerate(zip(diagonal, coupling, strict=True)):
        a, b, d = uu - lost[0], ut - lost[1], tt - lost[2]
        determinant = a * d - b * b
        u_u, u_t = (d * c_uu - b * c_tu) / determinant, (d * c_ut - b * c_tt) / determinant
        t_u, t_t = (a * c_tu - b * c_uu) / determinant, (a * c_tt - b * c_ut) / determinant
        lost = c_uu * u_u + c_tu * t_u, c_uu * u_t + c_tu * t_t, c_ut * u_t + c_tt * t_t
        if number >= start:
            share_u, share_t = -(share_u * u_u + share_t * t_u), -(share_u * u_t + share_t * t_t)
    return lost, share_u, share_t
