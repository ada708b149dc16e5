"""Shapes of modes between their nodes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsm.elements import number_of_terms, transfer_series
from dsm.spindle.sections import Sections
from dsm.spindle.spindle import Theory

_Float = NDArray[np.float64]


class StateVectors(NamedTuple):
    """Motion and internal forces of modes at places, shape (n_modes, n_places) each."""

    deflection: _Float
    """u, of the modes' own scale."""
    slope: _Float
    """t, rotation of the cross-section."""
    force: _Float
    """Shear force Q."""
    moment: _Float
    """Bending moment M."""


def between_nodes(
    shaft: Sections,
    theory: Theory,
    frequency: _Float,
    position: _Float,
    shape: tuple[_Float, _Float],
    places: _Float,
    left: NDArray[np.int_],
) -> StateVectors:
    """The modes of a shaft at rest inside its elements, exact.

    frequency (Hz), shape (n_modes,); position of the nodes (m) and the shape (deflection, slope) there, (n_modes,
    n_nodes) each; places (m), shape (n_places,), and the node left of each. What the element carries from its left node
    on, (u, t, Q, M)' = T (u1, t1, Q1, M1), must meet (u2, t2) at its right one: B (Q1, M1) = (u2, t2) - A (u1, t1).
    """
    start, end = position[left], position[left + 1]
    segment = shaft.segment_at((start + end) / 2)
    powers = np.vander((2 * np.pi * frequency) ** 2, number_of_terms(apart=False), increasing=True)
    whole, part = (
        np.moveaxis(transfer_series(shaft, theory, segment, start, to) @ powers.T, 3, 0) for to in (end, places)
    )
    near, far = (np.stack([values[:, node] for values in shape], axis=-1) for node in (left, left + 1))
    strain = far[..., np.newaxis] - whole[..., :2, :2] @ near[..., np.newaxis]
    forces = np.linalg.solve(whole[..., :2, 2:], strain)
    return StateVectors(*np.moveaxis((part @ np.concatenate([near[..., np.newaxis], forces], axis=2))[..., 0], 2, 0))
