"""Chatter among the lines that are left: f_c + k tooth passing, as one family."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lobewatch.cuts.listening.fold_frequency import family_distance
from lobewatch.cuts.listening.sorted_lines import WIDE
from lobewatch.cuts.listening.spectrum import Floats, SpectralLines

LOUD = 0.1
"""Share of the loudest amplitude that a line has that names chatter ..."""
PART = 1e-3
"""... and one that belongs to it."""
ANCHORS = 12
"""Lines whose families are compared."""
MULTIPLES = 3
"""Multiples of a frequency that are looked for."""
SHARE = 0.3
"""Weight of the displacement of a family beside the lines that it explains; chosen ..."""
LEAST = 0.25
"""... which has this share of the energy of the largest at least."""


@dataclass(frozen=True, eq=False)
class ChatterLines:
    """One family."""

    frequency: float
    """Frequency of the line with the largest displacement (Hz)."""
    error: float
    """Standard error of the frequency (Hz)."""
    lines: SpectralLines
    """All lines f_c + k tooth passing."""


def chatter_lines(left: SpectralLines, tooth_frequency: float, bin_: float) -> ChatterLines:
    """The family that chatter is named by; left: one line at least. All in Hz.

    Chatter that leaves the cut sounds with 2 f_c and 3 f_c and their side bands too. So that of the loudest lines is
    taken whose multiples explain the most, and whose displacement, amplitude over frequency squared, is large.
    """
    part = left.amplitude > PART * np.max(left.amplitude)
    weight = np.where(part, (left.amplitude / left.frequency**2) ** 2, 0.0)
    named = np.where(left.amplitude >= LOUD * np.max(left.amplitude), weight, 0.0)
    anchors = [i for i in np.argsort(-named)[:ANCHORS] if named[i] > 0]
    clear = np.where(part, np.log10(left.clearness), 0.0)
    families = [family_distance(left.frequency, left.frequency[i], tooth_frequency) < WIDE * bin_ for i in anchors]
    energy = np.array([np.sum(weight[family]) for family in families])
    explained = np.array([_explained(left, left.frequency[i], tooth_frequency, bin_) @ clear for i in anchors])
    large = energy / np.max(energy)
    score = np.where(large >= LEAST, explained / np.max(explained) + SHARE * large, 0.0)
    best = families[int(np.argmax(score))]
    top = int(np.argmax(np.where(best, named, 0.0)))
    error = float(left.frequency_error(bin_)[top])
    return ChatterLines(float(left.frequency[top]), error, left[best & part])


def has_side_bands(left: SpectralLines, chatter: ChatterLines, turn: float, bin_: float) -> bool:
    """Whether it has another line k tooth passings away, or one turn: a cut makes them, a pump has none. In Hz."""
    apart = np.abs(np.abs(left.frequency - chatter.frequency) - turn)
    return len(chatter.lines) > 1 or bool(np.any(apart < WIDE * bin_))


def _explained(left: SpectralLines, frequency: float, tooth_frequency: float, bin_: float) -> Floats:
    """Which lines are multiples of a frequency or side bands of those, 0 or 1, shape (n,)."""
    explained = np.zeros(len(left))
    for order in range(1, MULTIPLES + 1):
        apart = family_distance(left.frequency, order * frequency, tooth_frequency)
        explained[apart < WIDE * bin_ * max(1.0, order / 2)] = 1.0
    return explained
