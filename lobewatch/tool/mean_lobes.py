"""Diagrams by zero order of modes at the tip, whatever is open of their axes."""

from __future__ import annotations

from collections.abc import Sequence

from numpy.typing import ArrayLike

from lobes import Cut, StabilityLobes, lowest_of, shown_modes, zero_order
from lobewatch.tool.axes import mode_axes
from modal import Mode

Modes = Sequence[Mode] | None
"""Modes of one direction at the tool tip; None where neither direction is known."""


def mean_lobes(x: Modes, y: Modes, cuts: Sequence[Cut], speed_rpm: ArrayLike, cross: Modes = None) -> StabilityLobes:
    """The lowest limits of a cut in its directions of feed, and over the axes that taps in x, in y and across leave."""
    tips: list[tuple[Modes, Modes, Modes]] = [(x, y, None)]
    if x and y:
        patterns = mode_axes(x, y, cross).patterns
        tips = [(x, y, None) if axes is None else shown_modes([*x, *y], axes) for axes in patterns]
    return lowest_of([zero_order(x, y, cut, speed_rpm, across) for x, y, across in tips for cut in cuts])
