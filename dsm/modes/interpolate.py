"""Modes between their nodes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsm.elements.beam_series import beam_series
from dsm.modes.modes import Modes
from dsm.spindle.sections import sections
from dsm.spindle.spindle import SAME_PLACE, Spindle

_Float = NDArray[np.float64]


def interpolate(spindle: Spindle, modes: Modes, places: _Float) -> Modes:
    """The same modes of a shaft at rest at other places on it (m, shape (n,)), exact.

    A place inside an element of ends 1 and 2 divides it into two elements a and b. The forces at the place balance:
    (K_a22 + K_b11) (u, t) = -K_a21 (u1, t1) - K_b12 (u2, t2). A place as good as at a node has the values of the node.
    """
    left = np.clip(np.searchsorted(modes.position, places, side="right") - 1, 0, modes.position.size - 2)
    slack = SAME_PLACE * spindle.length
    from_left, from_right = places - modes.position[left], modes.position[left + 1] - places
    node = np.where(from_left <= slack, left, left + 1)
    deflection, slope = modes.deflection[:, node], modes.slope[:, node]
    inside = np.minimum(from_left, from_right) > slack
    deflection[:, inside], slope[:, inside] = _inside(spindle, modes, places[inside], left[inside])
    return Modes(modes.frequency, places, deflection, slope)


def _inside(spindle: Spindle, modes: Modes, places: _Float, left: NDArray[np.int_]) -> tuple[_Float, _Float]:
    pieces = sections(spindle)
    piece = pieces.index_at(places)
    w2 = (2 * np.pi * modes.frequency) ** 2
    a, b = (
        beam_series(spindle, pieces, piece, length)
        for length in (places - modes.position[left], modes.position[left + 1] - places)
    )
    a, b = (np.moveaxis(series @ np.vander(w2, series.shape[2], increasing=True).T, 2, 1) for series in (a, b))
    u1, t1, u2, t2 = (values[:, node] for node in (left, left + 1) for values in (modes.deflection, modes.slope))
    force = -(a[3] * u1 - a[4] * t1) - (b[3] * u2 + b[4] * t2)
    moment = -(a[4] * u1 + a[5] * t1) - (-b[4] * u2 + b[5] * t2)
    uu, ut, tt = a[0] + b[0], b[1] - a[1], a[2] + b[2]
    determinant = uu * tt - ut * ut
    return (tt * force - ut * moment) / determinant, (uu * moment - ut * force) / determinant
