"""What is drawn of a model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition import Frf
from dsm import Modes, Spindle, WhirlMap

_Float = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ModelPicture:
    """What is drawn of a model."""

    title: str
    """Headline."""
    spindle: Spindle
    """The shaft."""
    modes: Modes
    """Its modes along the shaft."""
    curve: tuple[_Float, _Float]
    """Bearing stiffness (N/m) and frequency (Hz) of the followed mode, shape (n,) each."""
    points: tuple[_Float, _Float]
    """The same of the tap tests."""
    whirl: WhirlMap
    """Whirl frequencies over speed."""
    highest_speed: float
    """End of the speed range of the machine (rpm)."""
    frf_place: str
    """Where force and motion of the frequency responses are, in words."""
    model_frf: Frf
    """Of the model."""
    measured_frf: Frf | None
    """Newest measured one of the same tool."""
