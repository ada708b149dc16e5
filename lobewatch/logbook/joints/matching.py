"""Which mode of the model a measured mode is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from lobewatch.logbook.joints.tapped_tools import TappedTool
from modal import Mode

FREQUENCY_ERROR = 0.03
"""Of the logarithm of a frequency of a model that is not fitted to it yet."""
STIFFNESS_ERROR = 0.7
"""The same of a stiffness: modes that are close exchange their shapes."""
LEFT_OUT = 9.0
"""Sum of squares of these above which a mode is none of the model: 9 % of frequency, or a factor of 8 of stiffness."""
NEAREST = 4
"""Modes of a tap test that are looked at beside the one followed, those nearest to it."""


class Match(NamedTuple):
    """The modes of a tap test in a model."""

    cost: float
    """Distance from those of the model, a sum of squares."""
    modes: tuple[tuple[int, Mode], ...]
    """Modes with their numbers in the model, in order."""


def match(tap: TappedTool, frequency: Sequence[float], stiffness: Sequence[float]) -> Match:
    """The cheapest way to number the modes of a tap test, in the order of the model, the one followed as it is known.

    frequency (Hz), stiffness (N/m): of the modes of the model where it was tapped. What fits none is left out, at a
    cost.
    """

    measured = sorted([tap.followed, *nearest(tap)], key=lambda mode: mode.frequency)
    best = [Match(0.0, ())] * (len(frequency) + 1)
    for mode in measured:
        skipped = math.inf if mode is tap.followed else LEFT_OUT
        row = [Match(best[0].cost + skipped, best[0].modes)]
        for number, model in enumerate(zip(frequency, stiffness, strict=True), 1):
            pair = _cost(mode, *model) if (mode is tap.followed) == (number == tap.number) else math.inf
            taken = Match(best[number - 1].cost + pair, (*best[number - 1].modes, (number, mode)))
            left = Match(best[number].cost + skipped, best[number].modes)
            row.append(min(taken, left, row[-1], key=lambda candidate: candidate.cost))
        best = row
    return best[-1]


def nearest(tap: TappedTool) -> list[Mode]:
    """Those other modes of a tap test that are looked at."""

    def distance(mode: Mode) -> float:
        return abs(math.log(mode.frequency / tap.followed.frequency))

    return sorted(tap.others, key=distance)[:NEAREST]


def _cost(mode: Mode, frequency: float, stiffness: float) -> float:
    """Of taking it for this one of the model."""
    apart = (
        math.log(mode.frequency / frequency) / FREQUENCY_ERROR,
        math.log(mode.stiffness / stiffness) / STIFFNESS_ERROR,
    )
    return apart[0] ** 2 + apart[1] ** 2
