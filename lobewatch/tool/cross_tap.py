"""Whether a cross tap belongs to the taps in x and y beside it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from acquisition import Remark
from lobewatch.tool.mean_lobes import Modes
from modal import Mode

NEAR = 0.01
"""Relative distance of a cross mode from the nearest mode of x or y, beyond which it is of another clamping; chosen."""
MOST = 1.5
"""Largest cross residue over sqrt(Rx Ry): above 1 by more than the errors of three stiffnesses it cannot be."""
ALIKE = 0.1
"""Relative difference of stiffnesses below which a cross mode is that of x or y; chosen: three times the scatter."""
LOUD = 0.3
"""Peak of a cross mode over the largest peak, from which on it is asked where it belongs."""


def fitting_cross(x: Modes, y: Modes, cross: Modes) -> tuple[Modes, tuple[Remark, ...]]:
    """The modes of a cross tap where they go with those of x and y; else None, and a remark that says why.

    None where one of the three is not known.
    """
    if not x or not y or cross is None:
        return None, ()
    problem = next(_problems(x, y, cross), None)
    if problem is None:
        return cross, ()
    cure = "tap x, y and xy of the tool as it is clamped now"
    return None, (Remark("cross-other-clamping", "", f"cross tap not used: {problem}", cure),)


def _problems(x: Sequence[Mode], y: Sequence[Mode], cross: Sequence[Mode]) -> Iterator[str]:
    """What of it does not go with them."""
    loudest = max((1 / (abs(mode.stiffness) * mode.damping_ratio) for mode in cross), default=0.0)
    loud = [mode for mode in cross if 1 / (abs(mode.stiffness) * mode.damping_ratio) >= LOUD * loudest]
    for name, side in (("x", x), ("y", y)):
        if loud and all(any(_is_alike(mode, other) for other in side) for mode in loud):
            yield f"it is the tap in {name} once more: hammer and sensor were in the same direction"
    possible = math.sqrt(math.prod(sum(1 / mode.stiffness for mode in side) for side in (x, y)))
    for mode in loud:
        at, share = mode.frequency, 1 / abs(mode.stiffness) / possible
        apart = min(abs(other.frequency / at - 1) for other in (*x, *y))
        if apart > NEAR:
            yield f"it shows {at:.0f} Hz, {100 * apart:.1f} % from the nearest mode of x and y: another clamping"
        if share > MOST:
            yield f"at {at:.0f} Hz it shows {share:.1f} times what x and y allow: other sensors or another clamping"


def _is_alike(mode: Mode, other: Mode) -> bool:
    """Whether two modes are one, sign and size of the stiffness included."""
    return abs(other.frequency / mode.frequency - 1) < NEAR and abs(other.stiffness / mode.stiffness - 1) < ALIKE
