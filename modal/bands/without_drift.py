"""An FRF without the drift of an accelerometer at rest."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from acquisition import Frf

FEWEST = 12
"""Lines that a drift is told from."""
HIGHEST = 1 / 16
"""Share of the highest frequency below which it is looked for."""
MOST_SCATTER = 0.1
"""Share of the drift that half of these lines may differ by; more is no drift."""
ROUNDING = 1e-9
"""Share of the FRF below which nothing but drift is left."""


def without_drift(frf: Frf) -> Frf:
    """Without A/f^2, A complex, where the range of low lines that is most like it is no more than that; else as it is.

    A constant error of an accelerance is such a drift of the receptance, of any phase; against the phase of a mode it
    turns the peak into a dip. Behind a high-pass filter it begins above the lowest lines.
    """
    drifts = [_drift(frf, lines) for lines in _ranges(frf)]
    scatter, drift = min(drifts, key=lambda candidate: candidate[0], default=(np.inf, 0.0))
    if scatter > MOST_SCATTER:
        return frf
    left = frf.receptance - drift / frf.frequency**2
    return replace(frf, receptance=left) if np.any(np.abs(left) > ROUNDING * np.abs(frf.receptance)) else frf


def _drift(frf: Frf, lines: slice) -> tuple[float, complex]:
    """What A is on these lines, after the share of it that half of them differ by."""
    constants = frf.receptance[lines] * frf.frequency[lines] ** 2
    middle = complex(np.median(constants.real), np.median(constants.imag))
    return (float(np.median(np.abs(constants - middle)) / abs(middle)) if middle else np.inf), middle


def _ranges(frf: Frf) -> Iterator[slice]:
    """Octaves of the low lines from the lowest up, none of fewer lines than a drift is told from."""
    f, start = frf.frequency, 0
    while start < f.size and f[start] < HIGHEST * f[-1]:
        end = max(int(np.searchsorted(f, 2 * f[start])), start + FEWEST)
        yield slice(start, end)
        start = end
