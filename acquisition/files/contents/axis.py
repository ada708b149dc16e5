"""Whether a time axis is even, judged as a whole: single steps of a printed time are never quite the same."""

from __future__ import annotations

from decimal import Decimal

import numpy as np
from numpy.typing import NDArray

EVEN = 0.05
"""Largest distance of a time from an even axis that is taken, in steps: 9 degrees of phase at half the sample rate.

Seven printed digits at 51.2 kHz are off by 0.003, single precision by 0.012 after 4 s, a lost sample by 0.5 or more."""
ROUNDED = 20
"""Steps that are uneven, at least, where few digits are the reason; a lost sample makes one so."""


def step_of(time: NDArray[np.float64]) -> tuple[float, str]:
    """The step of an even axis, and what is wrong with it; the text is empty where nothing is."""
    if time.size < 2 or not np.all(np.isfinite(time)):
        return 0.0, "its time is no row of finite numbers"
    step = float(time[-1] - time[0]) / (time.size - 1)
    if step <= 0:
        return 0.0, f"its time does not rise (from {time[0]:g} to {time[-1]:g}); sort its rows"
    beside = (time - time[0]) / step - np.arange(time.size)
    away = np.abs(beside - (beside.max() + beside.min()) / 2)
    worst = int(np.argmax(away))
    if away[worst] <= EVEN:
        return step, ""
    return step, (
        f"its time steps are uneven: sample {worst + 1} is {away[worst]:.2g} steps off an even axis, {EVEN:g} are "
        "taken (are samples missing, twice there, or not in order?)"
    )


def printed_step(time: NDArray[np.float64]) -> float | None:
    """The step of an even axis that was printed with few digits: each time lies within half its last one of it.

    None where no even axis is printed so, or where the steps are uneven in a few places only.
    """
    step = float(time[-1] - time[0]) / (time.size - 1)
    if np.sum(np.abs(np.diff(time) / step - 1) > EVEN) < ROUNDED:
        return None
    half = 0.5 * np.array([10.0 ** _last_place(value) for value in time[1:].tolist()]) * (1 + 1e-6)
    count = np.arange(1, time.size)
    least = float(np.max((time[1:] - half - time[0]) / count))
    most = float(np.min((time[1:] + half - time[0]) / count))
    return (least + most) / 2 if 0 < least <= most else None


def _last_place(value: float) -> int:
    """Power of ten of the last digit of a number."""
    exponent = Decimal(repr(value)).normalize().as_tuple().exponent
    return exponent if isinstance(exponent, int) else 0
