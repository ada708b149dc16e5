"""What is shown while a cut is listened to: one immutable picture of it, and the curves of what was heard."""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lobewatch.cuts.listening.judge_cut import line_kinds
from lobewatch.logbook.cut_comparison import CutComparison
from lobewatch.tap.plots import extremes

HIGHEST = 8000.0
"""Highest frequency of the curves (Hz)."""
Floats = NDArray[np.float64]


class CutStep(enum.StrEnum):
    """The word that can be read from 3 m."""

    SENSOR = "SENSOR TO HOUSING"
    """The accelerometer is moved, the device opened."""
    LISTENING = "LISTENING"
    """The spindle is heard to turn in air; the cut is waited for."""
    CUTTING = "CUTTING"
    """A cut has begun."""
    AGAIN = "CUT AGAIN"
    """It was no use; the next is waited for."""
    JUDGING = "JUDGING"
    """The cut is over."""
    STABLE = "STABLE"
    """What was heard, as the four words of CutWord."""
    CHATTER = "CHATTER"
    FLIP = "FLIP CHATTER"
    CANNOT_TELL = "CANNOT TELL"
    FAILED = "FAILED"
    """Nothing was heard; the reason says why, the cure what to do."""


@dataclass(frozen=True, eq=False)
class CutState:
    """One picture of listening to a cut."""

    revision: int
    """Number that rises with every change."""
    word: CutStep
    """Word that can be read from 3 m."""
    title: str
    """Machine and cut."""
    device: str = ""
    """DAQ, port and rate."""
    reason: str = ""
    """Sentence on what to do, or on why nothing was heard."""
    level: float | None = None
    """Root mean square of the acceleration over the newest 50 ms (m/s^2)."""
    left: float | None = None
    """Time for which a cut is still waited for (s)."""
    cut_seconds: float | None = None
    """Length of the cut heard so far (s)."""
    comparison: CutComparison | None = None
    """Cut as it was heard, beside what was expected of it; None before the end."""
    saved: str = ""
    """Name under which it is kept; empty where it is not, or not yet."""
    plots: Mapping[str, Floats] | None = None
    """Curves of what was heard, see cut_curves."""


def word_of(comparison: CutComparison) -> CutStep:
    """The word on what was heard."""
    return CutStep[comparison.heard.word.upper().replace(" ", "_")]


def cut_curves(comparison: CutComparison) -> dict[str, Floats]:
    """The spectrum up to 8 kHz as `frequency` (Hz) and `amplitude` (m/s^2), thinned, no peak lost; empty without one.

    For each name of `marked`, its lines as `NAME` (Hz) and `NAME_amplitude`; the modes as tapped as `x` and `y` (Hz).
    """
    spectrum = comparison.heard.spectrum
    if spectrum is None:
        return {}
    amplitude = np.sqrt(spectrum.power)
    at = extremes([amplitude], int(np.searchsorted(spectrum.frequency, HIGHEST, side="right")))
    curves = {"frequency": spectrum.frequency[at], "amplitude": amplitude[at]}
    for name, lines in line_kinds(comparison.heard).items():
        curves |= {name: lines.frequency, f"{name}_amplitude": lines.amplitude}
    if comparison.assembly is not None:
        for name, modes in (("x", comparison.assembly.x), ("y", comparison.assembly.y)):
            curves[name] = np.array([mode.frequency for mode in modes or ()])
    return curves
