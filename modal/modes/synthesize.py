"""The FRF that a set of modes has."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from acquisition import Frf
from modal.modes.mode import Mode


def synthesize(modes: Sequence[Mode], frequency: ArrayLike) -> Frf:
    """Sum of the receptances of modes at frequency (Hz), shape (n,). Raises ValueError for an axis that Frf refuses.

    >>> modes = [Mode(500.0, 0.02, 2e7), Mode(900.0, 0.03, 5e7)]
    >>> frf = synthesize(modes, np.arange(1.0, 1501.0))
    >>> round(float(abs(frf.receptance).max()) * 1e6, 2), int(frf.frequency[abs(frf.receptance).argmax()])  # um/N, Hz
    (1.25, 500)
    """
    f = np.asarray(frequency, dtype=np.float64)
    return Frf(f, sum((mode.receptance(f) for mode in modes), np.zeros(f.shape, complex)))
