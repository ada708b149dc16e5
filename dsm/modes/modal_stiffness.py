"""Stiffness of one mode at one place."""

from __future__ import annotations

from dsm.modes.modes_at import modes_at
from dsm.spindle.spindle import Spindle


def modal_stiffness(spindle: Spindle, mode: int = 1, position: float = 0.0) -> float:
    """Modal stiffness K of a mode (1 is the lowest) at `position` from the tool tip (m), in N/m; see modes_at.

    This, and not the static stiffness, is what the height of a peak of the measured FRF gives: |H| = 1/(2 zeta K).
    Raises ValueError for a mode below 1, and as modes_at.

    Of a shaft on two knife edges half the mass moves with its middle:

    >>> shaft = Spindle([Segment(0.5, 0.05)], [Bearing(0.0, np.inf), Bearing(0.5, np.inf)])
    >>> w = 2 * np.pi * natural_frequencies(shaft, 1)[0]
    >>> round(modal_stiffness(shaft, 1, position=0.25) / 1e6, 2)  # N/um
    25.1
    >>> round(float(shaft.mass / 2 * w**2) / 1e6, 2)
    25.1
    """
    if mode < 1:
        raise ValueError(f"mode={mode} is not at least 1, the lowest")
    return float(modes_at(spindle, mode, position)[1][-1])
