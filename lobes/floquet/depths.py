"""The one check of axial depths."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def check_depths(depth: ArrayLike) -> NDArray[np.float64]:
    """Axial depths (m) as a 1-D array; ValueError unless there is one at least and all are finite and >= 0."""
    depths = np.atleast_1d(np.asarray(depth, dtype=np.float64))
    if depths.ndim != 1 or depths.size == 0:
        raise ValueError(f"depth has shape {depths.shape}; a 1-D array of at least one depth (m) is needed")
    bad = np.flatnonzero(~(np.isfinite(depths) & (depths >= 0)))
    if bad.size:
        raise ValueError(f"depth[{bad[0]}]={depths[bad[0]]} is not a finite depth >= 0 m; 1 mm is 1e-3")
    return depths
