"""What is written beside the numbers."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

import numpy as np
from numpy.typing import NDArray

from acquisition.frf import Frf


@dataclass(frozen=True)
class Labels:
    """Of a tap test that is written for other programs."""

    created: datetime | None = None
    """Time of recording (timezone-aware)."""
    direction: str = ""
    """Direction at the tool tip, x or y."""
    tool: str = ""
    """Name of the tool in the spindle."""
    name: str = "tap test"
    """Title for people."""
    window: str = "none"
    """Window over the response, as it was read: "exponential 0.05 s"."""

    @property
    def plain_tool(self) -> str:
        """Without what would end it: line ends and semicolons."""
        return " ".join(self.tool.replace(";", ",").split())


SI = {"receptance": "m/N", "mobility": "m/s/N", "accelerance": "m/s^2/N"}
"""Unit of each form of an FRF."""


def as_measured(frf: Frf) -> tuple[NDArray[np.complex128], str]:
    """An FRF in the form that its sensors gave, which keeps it exact, and its unit."""
    values = {"receptance": frf.receptance, "mobility": frf.mobility, "accelerance": frf.accelerance}
    return values[frf.measured_as], SI[frf.measured_as]
