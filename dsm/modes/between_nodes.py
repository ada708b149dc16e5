"""Shapes of modes between their nodes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsm.elements.beam_series import beam_series
from dsm.spindle.sections import sections
from dsm.spindle.spindle import Spindle

_Float = NDArray[np.float64]


def between_nodes(
    spindle: Spindle,
    frequency: _Float,
    position: _Float,
    shape: tuple[_Float, _Float],
    places: _Float,
    left: NDArray[np.int_],
) -> tuple[_Float, _Float]:
    """Deflection and slope of the modes of a shaft at rest inside its elements, shape (n_modes, n_places) each, exact.

    frequency (Hz), shape (n_modes,); position of the nodes (m) and the shape (deflection, slope) there, (n_modes,
    n_nodes) each; places (m), shape (n_places,), and the node left of each. A place inside an element of ends 1 and 2
    divides it into two elements a and b. The forces at the place balance:
    (K_a22 + K_b11) (u, t) = -K_a21 (u1, t1) - K_b12 (u2, t2).
    """
    pieces = sections(spindle)
    piece = pieces.index_at(places)
    w2 = (2 * np.pi * frequency) ** 2
    a, b = (
        beam_series(spindle, pieces, piece, length) for length in (places - position[left], position[left + 1] - places)
    )
    a, b = (np.moveaxis(series @ np.vander(w2, series.shape[2], increasing=True).T, 2, 1) for series in (a, b))
    u1, t1, u2, t2 = (values[:, node] for node in (left, left + 1) for values in shape)
    force = -(a[3] * u1 - a[4] * t1) - (b[3] * u2 + b[4] * t2)
    moment = -(a[4] * u1 + a[5] * t1) - (-b[4] * u2 + b[5] * t2)
    uu, ut, tt = a[0] + b[0], b[1] - a[1], a[2] + b[2]
    determinant = uu * tt - ut * ut
    return (tt * force - ut * moment) / determinant, (uu * moment - ut * force) / determinant
