"""Whether other FRFs of the same structure have a mode too."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from modal.modes.mode import Mode

NEAR = 0.005
"""Relative distance of two frequencies within which a mode is there again; as asked of repeated measurements."""


def found_again(modes: Sequence[Mode], others: Sequence[Sequence[Mode]]) -> list[Mode]:
    """The modes, each with how many of the others have it within 0.5 %.

    others: modes, of any trust, of other FRFs of the same structure: sensors of the same hits, points, the same point
    measured again. `trust_of` doubts less what is found again.

    >>> once, twice = Mode(412.0, 0.01, 3e7), Mode(500.0, 0.02, 2e7)
    >>> others = [[Mode(500.4, 0.021, 5e7)], [Mode(499.1, 0.018, -4e7)]]
    >>> [mode.found_again for mode in found_again([once, twice], others)]
    [(0, 2), (2, 2)]
    """
    return [
        replace(mode, found_again=(sum(_has(other, mode.frequency) for other in others), len(others))) for mode in modes
    ]


def _has(modes: Sequence[Mode], frequency: float) -> bool:
    return any(abs(mode.frequency / frequency - 1) < NEAR for mode in modes)
