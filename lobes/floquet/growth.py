"""Whether milling grows or dies away from tooth to tooth."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lobes.floquet.milling_rows import MillingRows
from lobes.floquet.multipliers import spectral_radii

LIMITS = (1e-300, 1e300)
"""Magnitudes of multipliers that are told apart."""
SINGLE = 1e-5
"""Accuracy from which on numbers of single precision will do."""
RESIDUAL = 0.1
"""Residual of a multiplier over the accuracy that is asked for: that of a map that is not normal is off by several."""


def growth(
    rows: MillingRows, depth: NDArray[np.float64], numbers: NDArray[np.int64], tolerance: float = 1e-4
) -> NDArray[np.float64]:
    """Logarithm of the largest multiplier's magnitude at depths (r, d) in m, shape (r, d); negative where stable.

    numbers (r,): pieces of the tooth period (`piece_numbers`); tolerance: accuracy of the result near zero. With 1e-4
    it was off by 2.2e-5 at most where it is within 0.2 of zero, with `ROUGH` pieces by 6.9e-5: 12 906 depths of 1500
    random programs, up to twelve modes, helical ones and radial depths of 0.03 diameters among them.
    Source: as `spectral_radius`, whose logarithm it is.

    >>> mode = Mode(frequency=500.0, damping_ratio=0.02, stiffness=2e7)
    >>> slot = Cut(teeth=2, immersion=1.0, direction="up", tangential=700e6, radial=200e6)
    >>> rows = rows_of(milling_system([mode], [mode]), slot, np.array([12000.0]))
    >>> depths = np.array([[1e-9, 2e-3]])  # m
    >>> growth(rows, depths, piece_numbers(rows, 2e-3)).round(3).tolist()  # -zeta w T = -0.157 without a cut
    [[-0.157, -0.042]]
    """
    kind = np.float32 if tolerance >= SINGLE else np.float64
    radii = spectral_radii(rows, depth, numbers, RESIDUAL * tolerance, kind)
    return np.asarray(np.log(np.clip(radii, *LIMITS)))
