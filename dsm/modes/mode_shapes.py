"""Natural modes with their shapes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dsm.modes.find_modes import find_modes
from dsm.modes.modes import Modes
from dsm.spindle.places import SAME_PLACE
from dsm.spindle.spindle import Spindle


def mode_shapes(spindle: Spindle, count: int, places: ArrayLike | None = None) -> Modes:
    """The `count` lowest modes with deflection and slope at `places` from the tool tip (m), shape (n,), any order.

    None: at segment ends, bearings, masses and joints. Exact everywhere, inside long segments too; a joint has two
    sides, and at its place the values are those of the side away from the tool tip. With theory="timoshenko" the slope
    is the rotation of the cross-section. Raises ValueError for a place off the shaft, and as natural_frequencies.

    >>> shaft = Spindle([Segment(0.5, 0.05)], [Bearing(0.0, np.inf), Bearing(0.5, np.inf)])
    >>> modes = mode_shapes(shaft, 1, [0.125, 0.25, 0.375])
    >>> abs(modes.deflection[0] / modes.deflection[0, 1]).round(3).tolist()  # sin(pi z / L)
    [0.707, 1.0, 0.707]
    """
    modes = find_modes(spindle, count)
    return modes if places is None else modes.at(_on_shaft(spindle, places))


def _on_shaft(spindle: Spindle, places: ArrayLike) -> NDArray[np.float64]:
    position = np.asarray(places, dtype=np.float64)
    if position.ndim != 1:
        raise ValueError(f"places has shape {position.shape}; a 1-D array (m) is needed")
    slack = SAME_PLACE * spindle.length
    off = position[~((position >= -slack) & (position <= spindle.length + slack))]
    if off.size:
        raise ValueError(f"places holds {off[0]} m, which is off the shaft, 0 to {spindle.length:g} m")
    return np.clip(position, 0.0, spindle.length)
