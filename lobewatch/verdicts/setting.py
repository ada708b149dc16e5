"""What is recommended."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Setting:
    """A speed and a depth that would be called stable."""

    speed_rpm: float
    """Spindle speed (rpm), in steps of 10 unless it is the program's own."""
    depth_mm: float
    """Axial depth (mm), in steps of 0.05 unless it is the program's own."""
    window_rpm: tuple[float, float]
    """Slowest and fastest speed around it at which the depth would be called stable too."""
    depth_margin: float
    """Limit in the middle of the doubt over depth, less 1."""
    frequency_left: float
    """Fall of the frequency that it stands, relative, and is still called stable; 0.1 stands for that and more."""
