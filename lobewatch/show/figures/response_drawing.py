"""Draw phase, coherence and unexplained peaks of a frequency response."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from lobewatch.arrays import Complexes, Floats
from lobewatch.show.figures.drawing import Paint
from modal import UnexplainedPeak

PHASE_TICK_SPACING = 90.0
"""Distance between ticks of a phase (degrees)."""
MIN_COHERENCE_SHOWN = 0.9
"""Highest lower end of the axis of a coherence."""
MAX_NAMED_PEAKS = 3
"""Largest number of unexplained peaks named in a legend."""
MARK_SIZE = 8.0
"""Size of the mark of an unexplained peak (points)."""


def compute_phase(response: Complexes, lowest: float) -> Floats:
    """Return the phase (degrees) from a lowest value on, NaN where it jumps by a turn or the response is 0."""
    phase = (np.degrees(np.angle(response)) - lowest) % 360.0 + lowest
    jumps = np.abs(np.diff(phase, append=phase[-1:])) > 180.0
    return np.where(jumps | (response == 0), np.nan, phase)


def set_phase_axis(axes: Axes, lowest: float) -> None:
    """Label the axis of a phase that begins at a lowest value (degrees)."""
    axes.set(ylabel="phase (°)", ylim=(lowest, lowest + 360.0))
    axes.set_yticks(np.arange(lowest, lowest + 361.0, PHASE_TICK_SPACING))


def set_coherence_axis(axes: Axes) -> None:
    """Label the axis of a coherence that is drawn."""
    axes.set(ylabel="coherence", ylim=(min(MIN_COHERENCE_SHOWN, axes.get_ylim()[0]), 1.005))


def mark_unexplained(axes: Axes, peaks: Sequence[UnexplainedPeak], frequency: Floats, size: Floats) -> None:
    """Mark the peaks that the accepted modes do not explain on a curve, and name them in the legend."""
    places = [peak.frequency for peak in peaks]
    more = f" and {len(peaks) - MAX_NAMED_PEAKS} more" if len(peaks) > MAX_NAMED_PEAKS else ""
    label = f"not explained: {', '.join(f'{place:.0f}' for place in places[:MAX_NAMED_PEAKS])} Hz{more}"
    style: dict[str, Any] = {"marker": "v", "ms": MARK_SIZE, "ls": "", "mec": Paint.ALARM, "mew": 1.5, "mfc": "none"}
    if peaks:
        axes.plot(places, np.interp(places, frequency, size), label=label, **style)
