"""Critical speed of a spindle."""

from __future__ import annotations

from dsm.natural_frequencies import natural_frequencies
from dsm.spindle import Spindle, require_support


def critical_speed(spindle: Spindle) -> float:
    """Lowest critical speed (rpm): 60 times the first natural frequency (Hz).

    Exactly so for a round Euler-Bernoulli shaft whose bearings are as stiff in all directions. Raises ValueError for
    fewer than two bearings.
    """
    require_support(spindle)
    return 60 * float(natural_frequencies(spindle, 1)[0])
