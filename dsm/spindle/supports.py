"""Bearings in series with their housings, at rest or vibrating, with dampers and a loss factor."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsm.spindle.attachments import Bearing, shaft_share

_Complex = NDArray[np.complex128]


class Damping(NamedTuple):
    """Damping of a spindle, apart from its stiffness."""

    viscous: NDArray[np.float64]
    """Dampers of the bearings (N s/m), shape (n_bearings,)."""
    loss_factor: float
    """Loss factor eta of shaft, bearings, housing and joints (-): stiffness k becomes k (1 + i eta)."""

    @property
    def complexity(self) -> complex:
        """1 + i eta."""
        return 1 + 1j * self.loss_factor


class Supports(NamedTuple):
    """Radial springs with dampers, each before the spring of its housing; n frequencies, m bearings."""

    spring: _Complex
    """Stiffness of the bearings alone, dampers included (N/m), shape (n, m)."""
    softness: _Complex
    """Compliance of the housings (m/N), shape (m,)."""

    @property
    def share(self) -> _Complex:
        """Part of the motion of the shaft that goes into the bearing and not into its housing (-), shape (n, m)."""
        return np.asarray(shaft_share(self.spring, self.softness))

    @property
    def felt(self) -> _Complex:
        """Stiffness that the shaft feels (N/m), shape (n, m)."""
        return self.spring * self.share

    @property
    def slope(self) -> _Complex:
        """Derivative of what the shaft feels by the stiffness of the bearing (-), shape (n, m)."""
        return self.share**2

    def across(self, compliance: _Complex) -> _Complex:
        """Compliance across the springs of the bearings, (n, m, m), from that of the shaft on them (m/N).

        A pair of forces across a spring moves the shaft with the share a of it, and the housing by a times its
        compliance.
        """
        matrices = self.share[:, :, np.newaxis] * compliance * self.share[:, np.newaxis]
        diagonal = np.arange(self.softness.size)
        matrices[:, diagonal, diagonal] += self.share * self.softness
        return matrices


def supports(bearings: Sequence[Bearing], w: _Complex, damping: Damping) -> Supports:
    """The supports of bearings at angular frequencies w (rad/s), shape (n,); `damping` has one damper for each."""
    stiffness = np.array([bearing.stiffness for bearing in bearings])
    softness = np.array([1 / bearing.housing_stiffness for bearing in bearings])
    spring = damping.complexity * stiffness + 1j * w[:, np.newaxis] * damping.viscous
    return Supports(spring, softness / damping.complexity)


def given_damping(bearings: Sequence[Bearing], loss_factor: float) -> Damping:
    """The dampers of bearings with a loss factor, which is checked."""
    if not (math.isfinite(loss_factor) and loss_factor >= 0):
        raise ValueError(f"loss_factor={loss_factor} is not a finite number >= 0")
    return Damping(np.array([bearing.damping for bearing in bearings], dtype=np.float64), loss_factor)
