"""How alike two mode shapes are."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike


def mac(a: ArrayLike, b: ArrayLike) -> float:
    """Modal assurance criterion |a^H b|^2 / (a^H a b^H b) of two shapes (p,): 1 for the same shape, 0 for none of it.

    Raises ValueError for shapes of different length, and of zeros. Source: Allemang & Brown (1982), IMAC 1.

    >>> mac([1.0, 0.5, -0.2], [2.0, 1.0, -0.4])  # the same shape, another scale
    1.0
    >>> mac([1.0, 0.0], [0.0, 1.0])
    0.0
    """
    x, y = np.asarray(a), np.asarray(b)
    if x.shape != y.shape or x.ndim != 1:
        raise ValueError(f"mode shapes have shapes {x.shape} and {y.shape}; give two over the same points")
    size = float(np.vdot(x, x).real * np.vdot(y, y).real)
    if not size > 0:
        raise ValueError("a mode shape is zero or not finite at its points; leave it out")
    return float(np.abs(np.vdot(x, y)) ** 2 / size)
