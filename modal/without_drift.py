"""An FRF without the drift of an accelerometer at rest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from acquisition import Frf

LOWEST = 12
"""Lines that the drift is taken from, the lowest ones."""
MOST_SCATTER = 0.1
"""Share of the drift that these lines may differ by; more is no drift."""
ROUNDING = 1e-9
"""Share of the FRF below which nothing but drift is left."""


def without_drift(frf: Frf) -> Frf:
    """Without A/f^2, A complex, where the lowest lines are that and no more; as it is where they or all lines are not.

    A constant error of an accelerance is such a drift of the receptance, of any phase; against the phase of a mode it
    turns the peak into a dip.
    """
    drift = frf.receptance[:LOWEST] * frf.frequency[:LOWEST] ** 2
    middle = np.median(drift.real) + 1j * np.median(drift.imag)
    if np.max(np.abs(drift - middle)) > MOST_SCATTER * abs(middle):
        return frf
    left = frf.receptance - middle / frf.frequency**2
    return replace(frf, receptance=left) if np.any(np.abs(left) > ROUNDING * np.abs(frf.receptance)) else frf
