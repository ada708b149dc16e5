"""Block elimination along the shaft: the stiffness at one node."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from dsm.dynamic_stiffness import DynamicStiffness

_Complex = NDArray[np.complex128]


def condense(model: DynamicStiffness, w2: _Complex, node: int) -> tuple[_Complex, _Complex, _Complex]:
    """What the whole shaft opposes to deflection u and slope t of one node: K(u,u), K(u,t), K(t,t), (n,) each.

    w2: square of the angular frequency, shape (n,), (rad/s)^2. All other nodes are eliminated from both ends,
    all frequencies at once.
    """
    diagonal, coupling = (values.swapaxes(0, 1) for values in model.blocks(w2))
    left = _eliminate(diagonal[:node], coupling[:node])
    # From the far end down to the node, where the two sides of a coupling block change places.
    right = _eliminate(diagonal[:node:-1], coupling[: node - diagonal.shape[0] : -1][:, [0, 2, 1, 3]])
    uu, ut, tt = diagonal[node]
    return uu - left[0] - right[0], ut - left[1] - right[1], tt - left[2] - right[2]


def _eliminate(diagonal: Iterable[_Complex], coupling: Iterable[_Complex]) -> tuple[_Complex, _Complex, _Complex]:
    """Eliminate nodes one after the other: what the last one takes from the stiffness of the next."""
    nothing = np.zeros(1, dtype=np.complex128)
    lost = nothing, nothing, nothing
    for (uu, ut, tt), (c_uu, c_ut, c_tu, c_tt) in zip(diagonal, coupling, strict=True):
        a, b, d = uu - lost[0], ut - lost[1], tt - lost[2]
        determinant = a * d - b * b
        u_u, u_t = (d * c_uu - b * c_tu) / determinant, (d * c_ut - b * c_tt) / determinant
        t_u, t_t = (a * c_tu - b * c_uu) / determinant, (a * c_tt - b * c_ut) / determinant
        lost = c_uu * u_u + c_tu * t_u, c_uu * u_t + c_tu * t_t, c_ut * u_t + c_tt * t_t
    return lost
