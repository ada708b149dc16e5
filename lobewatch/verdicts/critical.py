"""How far the frequency may fall before the word on a program changes: to doubtful, and to not stable."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from lobewatch.verdicts.aging import FALLS, StiffnessAt, age, softening, tolerable_decay
from lobewatch.verdicts.draws import ProgramDraws
from lobewatch.verdicts.verdict import CriticalFall, Ruling, Verdict, Word

STEP = 0.0125
"""Step of the fall at which all draws are looked at."""
NEAR = 1e-3
"""Step of the fall over which the growth is taken to be straight."""
HALVINGS = 4
"""Halvings between the two looks at which the first of them chatters."""
NEIGHBOURS = 12
"""Number of draws of damping and stiffness that the error of the fall comes from."""


def critical_fall(verdict: Verdict) -> CriticalFall:
    """Falls of the frequency that change the word on a program; one beyond 20 % is not looked at."""
    draws = verdict.draws
    if verdict.assembly is None or draws is None or verdict.word is Word.UNKNOWN:
        return CriticalFall(math.nan, math.nan, math.nan)
    if verdict.word is Word.NOT_STABLE:
        return CriticalFall(0.0, 0.0, 0.0)
    stiffness_at, _ = softening(verdict.assembly)
    depth = verdict.program.depth_mm / 1e3
    last = tolerable_decay(draws, depth, stiffness_at)
    first = _first_doubt(draws, depth, last, stiffness_at) if verdict.word is Word.STABLE else 0.0
    return CriticalFall(min(first, last), last, _error(draws, depth, last, stiffness_at) if last < math.inf else 0.0)


def ruling_of(verdict: Verdict, falls: bool) -> Ruling:
    """What the history keeps of a verdict; falls: with the critical ones, which take as long as the verdict itself."""
    return verdict.ruling._replace(critical=critical_fall(verdict)) if falls else verdict.ruling


def is_missing(ruling: Ruling | None, falls: bool) -> bool:
    """Whether a program has to be judged to know its ruling; falls: with the critical ones."""
    return ruling is None or (falls and ruling.critical is None)


def _first_doubt(draws: ProgramDraws, depth: float, last: float, stiffness_at: StiffnessAt) -> float:
    """Largest fall up to which no draw chatters."""
    most = min(last, float(FALLS[-1]))

    def chatters(fall: float) -> bool:
        return bool(np.any(age(draws, np.array([fall]), stiffness_at).growth(depth) >= 0))

    good = 0.0
    for bad in np.linspace(0, most, math.ceil(most / STEP) + 1)[1:].tolist():
        if chatters(bad):
            break
        good = bad
    else:
        return last
    for _ in range(HALVINGS):
        middle = (good + bad) / 2
        good, bad = (good, middle) if chatters(middle) else (middle, bad)
    return good


def _error(draws: ProgramDraws, depth: float, last: float, stiffness_at: StiffnessAt) -> float:
    """Error of the fall at which the middle chatters, from its growth with damping and stiffness of some draws."""
    rows, middle = draws.rows[np.arange(1, NEIGHBOURS + 1)], draws[np.array([0])]
    alike = draws.rows[np.zeros(NEIGHBOURS, dtype=np.intp)]
    scattered = replace(draws, rows=replace(alike, damping_ratio=rows.damping_ratio, stiffness=rows.stiffness))
    spread = np.std(age(scattered, np.array([last]), stiffness_at).growth(depth))
    before, after = age(middle, last + np.array([-NEAR, NEAR]), stiffness_at).growth(depth)[:, 0]
    return float(spread * 2 * NEAR / abs(after - before)) if after != before else 0.0
