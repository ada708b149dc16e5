"""Chatter of milling by time-domain simulation, which shares only the conventions with `lobes`.

The tool is pushed a little away from the motion that repeats with each tooth (see `milling_steps`). What grows away
from it, flip (period two) and Hopf alike, is chatter; forced vibration is not.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from late_growth import late_growth
from milling_steps import Case, Floats, Modes, Stepper
from numpy.typing import NDArray

__all__ = ["Case", "Judgement", "Modes", "chatters", "judge"]

START = 1e-30
"""Push, in units of the feed per tooth: so small that strong chatter grows for many periods before contact is lost."""
LINEAR = 1e-3
"""Deviation below which the growth is measured; what has come so far from the start chatters."""
NOTHING = 1e-250
"""Deviation below which there is nothing left to measure."""
FIRST, LONGEST = 32, 1024
"""Periods after which cases are looked at for the first time (then after twice as many), and for the last."""
SURE = 0.05
"""A growth is settled when its doubt is below this share of it ..."""
STILL = 1e-6
"""... or below this."""
FEW = 12
"""Teeth times slices of cases that are stepped apart from those with more."""
MEMORY = 5_000_000
"""Teeth times slices times steps of the cases that are stepped together."""
ALIKE = 1.5
"""Cases are stepped together whose numbers of steps differ by this factor at most."""


@dataclass(frozen=True, eq=False)
class Judgement:
    """Result of each case."""

    chatters: NDArray[np.bool_]
    growth: Floats
    """Logarithm of the largest multiplier per tooth period; the border is at 0."""
    doubt: Floats
    """Uncertainty of the growth; a result is certain if this is less than the absolute growth."""
    periods: NDArray[np.int64]
    """Tooth periods that were simulated."""


def chatters(cases: Sequence[Case]) -> NDArray[np.bool_]:
    """Which cases chatter, shape (n,)."""
    return judge(cases).chatters


def judge(cases: Sequence[Case], fineness: float = 1.0, seed: int = 0) -> Judgement:
    """Simulate cases, each until its growth is settled; `fineness` multiplies the steps."""
    growth, doubt = np.full(len(cases), np.nan), np.full(len(cases), np.nan)
    periods = np.zeros(len(cases), dtype=np.int64)
    rng = np.random.default_rng(seed)
    steps = np.array([np.ceil(fineness * case.steps) for case in cases], dtype=np.int64)
    for group in _groups(cases, steps):
        members = [cases[i] for i in group]
        stepper = Stepper(members, int(np.max(steps[group])), START, rng)
        growth[group], doubt[group], periods[group] = _settle(stepper, len(group))
    return Judgement(growth > 0, growth, doubt, periods)


def _groups(cases: Sequence[Case], steps: NDArray[np.int64]) -> Iterator[list[int]]:
    """Cases to step together: alike in number of steps, and all with few or all with many teeth and slices."""
    width = np.array([case.slices * case.teeth for case in cases])
    group: list[int] = []
    for i in sorted(range(len(cases)), key=lambda i: (width[i] > FEW, steps[i])):
        if group:
            size = max(np.max(width[group]), width[i]) * steps[i] * (len(group) + 1)
            same = (width[i] > FEW) == (width[group[0]] > FEW)
            if size > MEMORY or steps[i] > ALIKE * steps[group[0]] or not same:
                yield group
                group = []
        group.append(i)
    if group:
        yield group


def _settle(stepper: Stepper, cases: int) -> tuple[Floats, Floats, NDArray[np.int64]]:
    """Growth, its uncertainty and periods of the cases of one stepper."""
    growth, doubt, periods = np.zeros(cases), np.zeros(cases), np.zeros(cases, dtype=np.int64)
    left, record = np.arange(cases), stepper.run(FIRST)
    while True:
        periods[left] = record.shape[1]
        looks = [_look(motion.reshape(len(motion), -1)) for motion in record]
        growth[left], doubt[left], over = np.array(looks).T
        going = (over == 0) & (doubt[left] > np.maximum(SURE * np.abs(growth[left]), STILL))
        if record.shape[1] >= LONGEST or not np.any(going):
            return growth, doubt, periods
        stepper.keep(going)
        left = left[going]
        record = np.concatenate([record[going], stepper.run(record.shape[1])], axis=1)


def _look(motion: Floats) -> tuple[float, float, bool]:
    """Growth, its uncertainty, and whether it has converged, from a motion (periods, values)."""
    size = np.max(np.abs(motion), axis=1)
    beyond = np.flatnonzero((size > LINEAR) | (size < NOTHING))
    linear = motion[: beyond[0]] if beyond.size else motion
    return *late_growth(linear), bool(beyond.size)
