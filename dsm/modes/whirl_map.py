"""Whirl frequencies over speed (Campbell diagram) and critical speeds."""

import math
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike

from dsm.arrays import Floats, check_numbers
from dsm.modes.find_modes import find_modes
from dsm.spindle.spindle import Spindle, require_support

MAX_CRITICAL_SPEED_RATIO = 32
"""Largest searched critical speed over the natural frequency without rotation."""


def critical_speed(spindle: Spindle, mode: int = 1) -> float:
    """Compute the critical speed of a mode: unbalance drives its forward whirl, at 60 f_n of the spinning shaft.

    For a round Euler-Bernoulli shaft without polar inertia it is 60 times the frequency without rotation. Otherwise
    gyroscopic moments raise the forward frequency with speed, more slowly than the speed itself where the two meet:
    each mode has one critical speed at most.

    Parameters
    ----------
    spindle : Spindle
        Supported spindle.
    mode : int
        Number of the mode; 1 is the lowest.

    Returns
    -------
    float
        Critical speed (rpm).

    Raises
    ------
    ValueError
        For a mode below 1 and for an unsupported shaft.
    ArithmeticError
        If there is none up to 32 times the frequency without rotation.

    Examples
    --------
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
        return 2 * math.pi * float(find_modes(spindle, mode, spin=spin).frequency[-1]) - spin

    at_rest = lead(0.0)
    low, high = 0.0, 2 * at_rest
    while lead(high) > 0:
        low, high = high, 2 * high
        if high > MAX_CRITICAL_SPEED_RATIO * at_rest:
            raise ArithmeticError(f"mode {mode} has no critical speed up to {low * 30 / math.pi:.6g} rpm")
    return float(scipy.optimize.brentq(lead, low, high, xtol=1e-12 * at_rest, rtol=1e-13)) * 30 / math.pi


@dataclass(frozen=True, eq=False)
class WhirlMap:
    """Whirl frequencies of a spindle over speed, in the fixed and in the rotating frame."""

    speed_rpm: Floats
    """Speeds (rpm), shape (m,)."""
    forward: Floats
    """Forward whirl seen from the housing (Hz), lowest first, shape (count, m)."""
    backward: Floats
    """Backward whirl seen from the housing (Hz), lowest first, shape (count, m)."""
    critical_rpm: Floats
    """Critical speeds of these forward whirls (rpm), rising, within `speed_rpm`."""

    @property
    def rotating_forward(self) -> Floats:
        """Forward whirl seen from the shaft (Hz): |forward - speed|, 0 at a critical speed; shape (count, m)."""
        return np.abs(self.forward - self.speed_rpm / 60)

    @property
    def rotating_backward(self) -> Floats:
        """Backward whirl seen from the shaft (Hz): backward + speed; shape (count, m)."""
        return self.backward + self.speed_rpm / 60


def whirl_map(spindle: Spindle, speed_rpm: ArrayLike, count: int) -> WhirlMap:
    """Compute the lowest forward and backward whirl frequencies over speed, proved complete (Campbell diagram).

    For an Euler-Bernoulli shaft without polar inertia they equal the natural frequencies without rotation. Only the
    view from the shaft changes, |f -+ speed/60|: figure 9 of Gaber & Hashemi, Shock and Vibration, 2015.
    Rotary inertia (theory="timoshenko") and polar inertia of masses separate them: forward rises, backward falls. Whirl
    is
    circular, as the bearings are equally stiff in all directions.

    Parameters
    ----------
    spindle : Spindle
        Supported spindle.
    speed_rpm : array_like, shape (m,)
        Speeds (rpm), >= 0.
    count : int
        Number of whirl frequencies of each sense.

    Returns
    -------
    WhirlMap
        Frequencies and critical speeds.

    Raises
    ------
    ValueError
        For speeds below 0 or not finite, a count below 1 and an unsupported shaft.
    ArithmeticError
        If rounding spoils the count of modes.

    Examples
    --------
    >>> shaft = Spindle([Segment(0.5, 0.05)], [Bearing(0.0, np.inf), Bearing(0.5, np.inf)])
    >>> whirl = whirl_map(shaft, [0.0, 12000.0], count=1)
    >>> whirl.rotating_forward.round(1).tolist()  # Hz, seen from the shaft: |f - 200|
    [[406.2, 206.2]]
    >>> whirl.rotating_backward.round(1).tolist()  # f + 200
    [[406.2, 606.2]]
    """
    require_support(spindle)
    speed = check_numbers("speed_rpm", speed_rpm, " rpm", " of at least one speed (rpm)", least=1)
    spins = speed * np.pi / 30
    # Both senses of a speed one after the other: they share a matrix.
    frequencies = [[find_modes(spindle, count, spin=sense * spin).frequency for sense in (1.0, -1.0)] for spin in spins]
    forward, backward = np.moveaxis(np.reshape(frequencies, (-1, 2, count)), 0, 2)
    # The critical speeds are those of each mode ahead of the slowest speed and behind the fastest.
    slowest, fastest = np.argmin(speed), np.argmax(speed)
    ahead = forward[:, slowest] >= speed[slowest] / 60
    crossed = np.flatnonzero(ahead & (forward[:, fastest] <= speed[fastest] / 60))
    critical = np.array([critical_speed(spindle, int(mode) + 1) for mode in crossed], dtype=np.float64)
    return WhirlMap(speed, forward, backward, critical)
