"""Chatter among the lines that are left: f_c + k tooth passing, as one family."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lobewatch.analysis.listening.sorted_lines import WIDE
from lobewatch.analysis.listening.spectrum import Floats, Lines

LOUD = 0.1
"""Share of the loudest amplitude that a line has that names chatter ..."""
PART = 1e-3
"""... and one that belongs to it."""
ANCHORS = 8
"""Lines whose families are compared."""


@dataclass(frozen=True, eq=False)
class ChatterLines:
    """One family."""

    frequency: float
    """Of the line with the largest displacement (Hz)."""
    error: float
    """Standard error (Hz)."""
    lines: Lines
    """All lines f_c + k tooth passing."""


def chatter_lines(left: Lines, tooth_frequency: float, bin_: float) -> ChatterLines:
    """The family of largest displacement, amplitude over frequency squared; left: one line at least. All in Hz."""
    loudest = float(np.max(left.amplitude))
    weight = np.where(left.amplitude > PART * loudest, (left.amplitude / left.frequency**2) ** 2, 0.0)
    named = np.where(left.amplitude >= LOUD * loudest, weight, 0.0)
    anchors = [i for i in np.argsort(-named)[:ANCHORS] if named[i] > 0]
    families = [modulo(left.frequency, left.frequency[i], tooth_frequency) < WIDE * bin_ for i in anchors]
    best = families[int(np.argmax([np.sum(weight[family]) for family in families]))]
    top = int(np.argmax(np.where(best, named, 0.0)))
    error = bin_ * np.hypot(0.3 / np.sqrt(left.clearness[top]), 0.03)
    return ChatterLines(float(left.frequency[top]), float(error), left[best & (weight > 0)])


def modulo(frequency: Floats | float, other: float, tooth_frequency: float) -> Floats:
    """Distance of frequencies from +-other + k tooth passing (Hz): those that chatter at one of them sounds with."""
    apart = [(frequency - sign * other) / tooth_frequency for sign in (1, -1)]
    return np.asarray(tooth_frequency * np.minimum(*(np.abs(one - np.round(one)) for one in apart)))
