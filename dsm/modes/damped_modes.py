"""Natural modes with damping."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsm.modes.damped_shaft import DampedShaft
from dsm.spindle.spindle import Spindle
from dsm.spindle.supports import given_damping


@dataclass(frozen=True, eq=False)
class DampedModes:
    """Modes that die away as exp(s t), each in the place of the undamped mode from which it comes."""

    frequency: NDArray[np.float64]
    """|s|/2 pi (Hz), shape (n_modes,); where damping is uneven they need not rise."""
    damping_ratio: NDArray[np.float64]
    """zeta = -Re s/|s| (-), shape (n_modes,)."""


def damped_modes(spindle: Spindle, count: int, loss_factor: float = 0.0) -> DampedModes:
    """The `count` lowest modes of the shaft at rest, with the dampers of its bearings and a loss factor, exact.

    loss_factor eta: shaft, bearings, housing and joints have the stiffness k (1 + i eta). Alone it gives each mode
    zeta = sin(atan(eta)/2), for small ones eta/2. Each certified undamped mode is followed up to the given damping by
    Newton steps on the complex matrix K(w), s = i w, from the estimate of first order. A loss factor is a model of
    steady vibration; the more a mode is damped, the less it means.

    Raises ValueError for a count below 1, a shaft that is not held and a loss factor below 0, ArithmeticError for a
    mode that does not oscillate any more.

    A loss factor alone gives every mode half of it as damping ratio, sin(atan(eta) / 2):

    >>> spindle = Spindle([Segment(0.1, 0.03), Segment(0.4, 0.06)], [Bearing(0.15, 2.5e8), Bearing(0.4, 2.5e8)])
    >>> damped_modes(spindle, 3, loss_factor=0.04).damping_ratio.round(5).tolist()
    [0.01999, 0.01999, 0.01999]
    >>> round(float(np.sin(np.arctan(0.04) / 2)), 5)
    0.01999
    """
    target = given_damping(spindle.bearings, loss_factor)
    shaft = DampedShaft.of(spindle, count)
    modes = [shaft.follow(number, shaft.start(number), shaft.none, target) for number in range(1, count + 1)]
    return DampedModes(
        np.array([abs(mode.w) / (2 * np.pi) for mode in modes]), np.array([mode.damping_ratio for mode in modes])
    )
