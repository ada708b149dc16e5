"""The FRF that a set of modes has."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from acquisition import Frf
from modal.modes.mode import Mode


def synthesize(modes: Sequence[Mode], frequency: ArrayLike) -> Frf:
    """Sum of the receptances of modes at frequency (Hz), shape (n,). Raises ValueError for an axis that Frf refuses."""
    f = np.asarray(frequency, dtype=np.float64)
    return Frf(f, sum((mode.receptance(f) for mode in modes), np.zeros(f.shape, complex)))
