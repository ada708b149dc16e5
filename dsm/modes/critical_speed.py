"""Critical speeds of a spindle."""

from __future__ import annotations

import math

import scipy

from dsm.modes.find_modes import find_modes
from dsm.spindle.spindle import Spindle, require_support

FARTHEST = 32
"""The search for a critical speed ends at so many times the natural frequency at rest."""


def critical_speed(spindle: Spindle, mode: int = 1) -> float:
    """Speed (rpm) whose unbalance drives the forward whirl of a mode (1 is the lowest): 60 f_n of the shaft that spins.

    For a round Euler-Bernoulli shaft without polar inertia it is 60 times the frequency at rest. Otherwise gyroscopic
    moments lift the forward frequency with speed, at a rate below that of the speed itself where the two meet: each
    mode has one critical speed at most.

    Raises ValueError for a mode below 1 and for a shaft that is not held, ArithmeticError where there is none up to
    32 times the frequency at rest.

    >>> ends = [Bearing(0.0, np.inf), Bearing(0.5, np.inf)]
    >>> shaft = Spindle([Segment(0.5, 0.05)], ends)
    >>> round(critical_speed(shaft)), round(60 * natural_frequencies(shaft, 1)[0])  # rpm
    (24373, 24373)
    >>> disk = LumpedMass(0.1, mass=3.0, diametral_inertia=0.005, polar_inertia=0.01)  # kg, kg m^2: gyroscopic moments
    >>> laden = Spindle([Segment(0.5, 0.05)], ends, masses=[disk])
    >>> round(critical_speed(laden)), round(60 * natural_frequencies(laden, 1)[0])
    (21819, 21250)
    """

    if mode < 1:
        raise ValueError(f"mode={mode} is not at least 1, the lowest")
    require_support(spindle)

    def lead(spin: float) -> float:
        """Forward whirl less speed (rad/s)."""
        return 2 * math.pi * float(find_modes(spindle, mode, spin=spin).frequency[-1]) - spin

    at_rest = lead(0.0)
    low, high = 0.0, 2 * at_rest
    while lead(high) > 0:
        low, high = high, 2 * high
        if high > FARTHEST * at_rest:
            raise ArithmeticError(
                f"mode {mode} has no critical speed up to {low * 30 / math.pi:.6g} rpm: its forward whirl stays ahead"
            )
    return float(scipy.optimize.brentq(lead, low, high, xtol=1e-12 * at_rest, rtol=1e-13)) * 30 / math.pi
