"""How far a spindle may decay before a program chatters."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from lobes.program import Modes, Program, stable_at

STEP = 0.002
"""Fall of the frequency from one look to the next, relative to the baseline."""
HALVINGS = 10
"""Bisections of that step."""


def tolerable_decay(program: Program, modes_at: Callable[[float], tuple[Modes, Modes]], largest: float = 0.2) -> float:
    """Largest fall of the natural frequency, relative to now, up to which the program stays stable all the way.

    modes_at gives the modes in x and y for a frequency ratio (new over now, 1 first); `lobes.aged_mode` makes them by
    one rule for K. 0.0 where the program is unstable now, inf where nothing happens up to `largest`. Looks every
    0.2 % of fall, by semi-discretisation. Raises ValueError for a `largest` outside (0, 1).
    """
    if not 0 < largest < 1:
        raise ValueError(f"largest={largest} is not between 0 and 1; 0.2 looks down to 80 % of the frequency")

    def stable(fall: float) -> bool:
        x, y = modes_at(1 - fall)
        return bool(stable_at(program, x, y, np.array([program.speed_rpm]))[0])

    falls = np.append(np.arange(0, largest, STEP), largest)
    first = next((i for i, fall in enumerate(falls) if not stable(float(fall))), None)
    if first is None:
        return float("inf")
    if first == 0:
        return 0.0
    low, high = float(falls[first - 1]), float(falls[first])
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if stable(middle) else (low, middle)
    return low
