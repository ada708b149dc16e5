"""How far the frequency may fall before the word on a program changes: to doubtful, and to not stable."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from lobewatch.verdicts.aging import FALLS, StiffnessAt, aged, softening, tolerable_decay
from lobewatch.verdicts.drawn import Drawn
from lobewatch.verdicts.verdict import CriticalFall, Ruling, Verdict, Word

STEP = 0.0125
"""Of the fall, at which all draws are looked at."""
NEAR = 1e-3
"""Of the fall, over which the growth is taken to be straight."""
HALVINGS = 4
"""Between the two looks at which the first of them chatters."""
NEIGHBOURS = 12
"""Draws of damping and stiffness that the error of the fall comes from."""


def critical_fall(found: Verdict) -> CriticalFall:
    """Both for a program; a fall beyond 20 % is not looked at."""
    if found.assembly is None or found.drawn is None or found.word is Word.UNKNOWN:
        return CriticalFall(math.nan, math.nan, math.nan)
    if found.word is Word.NOT_STABLE:
        return CriticalFall(0.0, 0.0, 0.0)
    stiffness_at, _ = softening(found.assembly)
    depth = found.program.depth_mm / 1e3
    last = tolerable_decay(found.drawn, depth, stiffness_at)
    first = _first_doubt(found.drawn, depth, last, stiffness_at) if found.word is Word.STABLE else 0.0
    return CriticalFall(
        min(first, last), last, _error(found.drawn, depth, last, stiffness_at) if last < math.inf else 0.0
    )


def ruling_of(found: Verdict, falls: bool) -> Ruling:
    """What the history keeps of a verdict; falls: with the critical ones, which take as long as the verdict itself."""
    return found.ruling._replace(critical=critical_fall(found)) if falls else found.ruling


def is_missing(ruling: Ruling | None, falls: bool) -> bool:
    """Whether a program has to be judged to know its ruling; falls: with the critical ones."""
    return ruling is None or (falls and ruling.critical is None)


def _first_doubt(drawn: Drawn, depth: float, last: float, stiffness_at: StiffnessAt) -> float:
    """Largest fall up to which no draw chatters."""
    most = min(last, float(FALLS[-1]))

    def chatters(fall: float) -> bool:
        return bool(np.any(aged(drawn, np.array([fall]), stiffness_at).growth(depth) >= 0))

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


def _error(drawn: Drawn, depth: float, last: float, stiffness_at: StiffnessAt) -> float:
    """Of the fall at which the middle chatters, from its growth with damping and stiffness of some draws."""
    rows, middle = drawn.rows[np.arange(1, NEIGHBOURS + 1)], drawn.some(np.array([0]))
    alike = drawn.rows[np.zeros(NEIGHBOURS, dtype=np.intp)]
    scattered = replace(drawn, rows=replace(alike, damping_ratio=rows.damping_ratio, stiffness=rows.stiffness))
    spread = np.std(aged(scattered, np.array([last]), stiffness_at).growth(depth))
    before, after = aged(middle, last + np.array([-NEAR, NEAR]), stiffness_at).growth(depth)[:, 0]
    return float(spread * 2 * NEAR / abs(after - before)) if after != before else 0.0
