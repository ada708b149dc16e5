"""One cut as a shop runs it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lobes.cut import Cut
from lobes.spectral_radius import spectral_radius
from modal import Mode

Modes = Sequence[Mode] | None
"""Modes of one direction; None where it is rigid or not known."""

SHARES = (0.25, 0.5, 0.75, 1.0)
"""A program is stable where it is so at all these shares of its depth: an island above a limit is none to work in."""

LIMITS = (1e-300, 1e300)
"""Radii that are told apart."""


@dataclass(frozen=True)
class Program:
    """A cut at a speed and an axial depth. Raises ValueError where one is not > 0."""

    cut: Cut
    """Cutter, immersion and material."""
    speed_rpm: float
    """Spindle speed (rpm)."""
    depth: float
    """Axial depth of cut (m)."""

    def __post_init__(self) -> None:
        """Refuse what is no speed or depth."""
        if not (np.isfinite(self.speed_rpm) and self.speed_rpm > 0):
            raise ValueError(f"speed_rpm={self.speed_rpm} is not a finite speed > 0 rpm; give that of the program")
        if not (np.isfinite(self.depth) and self.depth > 0):
            raise ValueError(f"depth={self.depth} m is not a finite depth > 0; 1 mm is 1e-3")


def stable_at(program: Program, x: Modes, y: Modes, speed_rpm: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether the program would be stable at other speeds (rpm), shape (n,), by semi-discretisation."""
    return log_radius(program, x, y, speed_rpm) < 0


def log_radius(program: Program, x: Modes, y: Modes, speed_rpm: NDArray[np.float64]) -> NDArray[np.float64]:
    """Logarithm of the largest spectral radius over SHARES at speeds (rpm), shape (n,); negative where stable."""
    depths = program.depth * np.array(SHARES)
    radius = spectral_radius(x, y, program.cut, speed_rpm, depths[-1])[:, 0]
    still = np.flatnonzero(radius < 1)
    if still.size:
        radius[still] = np.maximum(
            radius[still], np.max(spectral_radius(x, y, program.cut, speed_rpm[still], depths[:-1]), axis=1)
        )
    return np.log(np.clip(radius, *LIMITS))
