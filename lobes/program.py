"""One cut as a shop runs it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lobes.cut import Cut
from modal import Mode

Modes = Sequence[Mode] | None
"""Modes of one direction; None where it is rigid or not known."""

SHARES = (0.25, 0.5, 0.75, 1.0)
"""A program is stable where it is so at all these shares of its depth: an island above a limit is none to work in."""


@dataclass(frozen=True)
class Program:
    """A cut at a speed and an axial depth. Raises ValueError where one is not > 0.

    >>> slot = Cut(teeth=2, immersion=1.0, direction="up", tangential=700e6, radial=200e6)
    >>> Program(slot, speed_rpm=12000.0, depth=-0.002)
    Traceback (most recent call last):
        ...
    ValueError: depth=-0.002 m is not a finite depth > 0; 1 mm is 1e-3
    """

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
