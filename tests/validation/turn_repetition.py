"""Share of a simulated cut that does not repeat from turn to turn."""

from __future__ import annotations

import numpy as np

from acquisition.emulation import MillingCut, Passage, TipMotion

COMPARED_TURNS = 8
"""Spindle turns that are compared."""


def nonperiodic_share(motion: TipMotion, cut: MillingCut, passage: Passage) -> float:
    """Share of the rms that does not repeat from turn to turn late at full depth; 0 for less than two turns.

    It is 0 for a stable cut, and for flip chatter with an even number of teeth. A cut above its limit may be stable if
    run-out keeps teeth out of it.
    """
    begin = round(passage.before * motion.sample_rate)
    full = motion.acceleration[:, begin : begin + round((passage.ramp + passage.steady) * motion.sample_rate)].T
    turn = round(motion.sample_rate * cut.tooth_period * cut.teeth)
    number = min(COMPARED_TURNS, len(full) // turn)
    if number < 2:
        return 0.0
    turns = full[-number * turn :].reshape(number, -1)
    return float(np.sqrt(np.mean((turns - np.mean(turns, axis=0)) ** 2) / np.mean(turns**2)))
