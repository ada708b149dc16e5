"""What stands for all that lies outside a band."""

from __future__ import annotations

import numpy as np

from modal.fitting.fit_at_poles import Array

POWERS = (-2, 0, 2, 4, 6, 8)
"""Of the frequency, in the order in which residual terms are taken."""
LEAST_TERMS = 4
"""Complex residual terms that every band has."""
MOST_TERMS = len(POWERS)
"""Complex residual terms that a band has at most."""


def residual_powers(frequency: Array, terms: int) -> Array:
    """The first powers of the frequency, shape (terms, n)."""
    square = (frequency / np.mean(frequency)) ** 2
    return np.stack([square ** (power // 2) for power in POWERS[:terms]])
