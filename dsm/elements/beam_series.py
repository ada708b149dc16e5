"""Power series of the beam elements of a shaft."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsm.elements.element_series import TERMS, element_series
from dsm.elements.timoshenko_series import timoshenko_series
from dsm.spindle.sections import Sections
from dsm.spindle.spindle import Spindle

_Float = NDArray[np.float64]


def beam_series(
    spindle: Spindle, pieces: Sections, piece: NDArray[np.int_], length: _Float, spin: float | None = None
) -> _Float:
    """Series of beam elements by the theory of the spindle, shape (6, n_elements, n_terms), rows as in element_series.

    piece: the piece that each element is part of, shape (n_elements,). length: their lengths (m), the same shape.
    spin (rad/s): powers of w, as in assemble; None: of w^2.
    """
    rigidity, mass = pieces.rigidity[piece], pieces.mass[piece]
    terms = TERMS if spin is None else 2 * TERMS - 1
    if spindle.theory == "timoshenko":
        rotary, shear = pieces.rotary[piece], pieces.shear[piece]
        return timoshenko_series(rigidity, mass, rotary, shear, length, terms, spin)
    series = np.zeros((6, length.size, terms))
    series[..., :: 1 if spin is None else 2] = element_series(rigidity, mass, length)
    return series
