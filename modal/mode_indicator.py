"""Where a structure vibrates in a real mode, seen in several FRFs at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from acquisition import Frf


def mode_indicator(frfs: Sequence[Frf]) -> NDArray[np.float64]:
    """Mode indicator 1 - sum |Re G| |G| / sum |G|^2 over the receptances G, on every line, shape (n,).

    It comes near 1 where all points move a quarter period behind the force, at the natural frequency of a real mode
    that stands alone, and near 0 elsewhere. Zero where nothing moves. Raises ValueError for no FRF and for FRFs with
    different lines. Source: Hunt, Vold, Peterson & Williams (1984), SAE 841581.

    >>> frf = synthesize([Mode(500.0, 0.02, 2e7)], [250.0, 500.0])
    >>> mode_indicator([frf]).round(3).tolist()  # 1 at the natural frequency
    [0.0, 1.0]
    """
    if not frfs:
        raise ValueError("there is no FRF; give one or more")
    if any(not np.array_equal(frf.frequency, frfs[0].frequency) for frf in frfs):
        raise ValueError("the FRFs differ in their frequency lines; measure or export all with the same settings")
    receptance = np.array([frf.receptance for frf in frfs])
    size = np.abs(receptance)
    energy = np.sum(size**2, axis=0)
    still = energy == 0
    real = np.sum(np.abs(receptance.real) * size, axis=0)
    return np.where(still, 0.0, 1 - real / np.where(still, 1.0, energy))
