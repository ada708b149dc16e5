"""Checked frequencies."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def frequency_axis(frequency: ArrayLike) -> NDArray[np.float64]:
    """The frequencies (Hz) as an array of shape (n,), one number as (1,); ValueError unless finite and >= 0."""
    f = np.atleast_1d(np.asarray(frequency, dtype=np.float64))
    if f.ndim != 1:
        raise ValueError(f"frequency has shape {f.shape}; a 1-D array (Hz) is needed")
    bad = f[~(np.isfinite(f) & (f >= 0))]
    if bad.size:
        raise ValueError(f"frequency={bad[0]} Hz is not a finite number >= 0")
    return f
