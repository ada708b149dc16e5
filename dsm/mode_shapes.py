"""Natural modes with their shapes."""

from __future__ import annotations

from dsm.find_modes import find_modes
from dsm.modes import Modes
from dsm.spindle import Spindle


def mode_shapes(spindle: Spindle, count: int) -> Modes:
    """The `count` lowest modes with deflection and slope at segment ends and bearings.

    Raises as natural_frequencies does.
    """
    return find_modes(spindle, count)
