"""Whether a frequency that has no unit may be in rad/s: by its name, or as its steps are round in Hz alone."""

from __future__ import annotations

import math
import re

import numpy as np

from acquisition.files.contents.contents import Signal

_IN_HZ = re.compile(r"f|hz|column \d+|(?!.*(ang|circ|omega|rad)).*freq.*", re.IGNORECASE)
"""Names of a frequency proper, and that of a column that has none."""
_DIGITS, _OFF = 5, 3e-7
"""Digits of a round step, and how far, relative, one may be off that: the last of seven printed digits."""


def is_angular(axis: Signal) -> bool:
    """Whether it may be."""
    values = np.asarray(axis.values.real, dtype=np.float64)
    step = float(values[-1] - values[0]) / max(values.size - 1, 1)
    return not _IN_HZ.fullmatch(axis.name.strip()) or (not _is_round(step) and _is_round(step / (2 * math.pi)))


def _is_round(step: float) -> bool:
    return step > 0 and abs(float(f"{step:.{_DIGITS - 1}e}") / step - 1) < _OFF
