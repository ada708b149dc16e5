"""Where to go with a program: settings that would be called stable, with something to spare; how much decay is left."""

from __future__ import annotations

import math
from dataclasses import dataclass

from acquisition import Remark
from lobewatch.machine import Machine
from lobewatch.verdicts.aging import softening, tolerable_decay
from lobewatch.verdicts.setting_search import SPARE, Setting, SettingSearch
from lobewatch.verdicts.verdict import Verdict, Word


@dataclass(frozen=True)
class Advice:
    """What goes beyond the word."""

    best: Setting | None = None
    """At the program's depth, the nearest window of speeds; where there is none, the most chips per time. None where
    the program is stable, nothing is safe, or nothing can be said."""
    here: Setting | None = None
    """The deepest cut at the program's own speed, where `best` has another depth."""
    decay: float = math.nan
    """Tolerable fall of the frequency in the middle of the doubt, relative; 0 where it is not stable now, inf where
    nothing happens down to 80 %, NaN where the program could not be checked."""
    remarks: tuple[Remark, ...] = ()
    """What the decay rests on."""


def advise(found: Verdict, machine: Machine) -> Advice:
    """Advice beside a verdict; empty where it is unknown."""
    if found.assembly is None or found.drawn is None:
        return Advice()
    stiffness_at, remark = softening(found.assembly)
    decay = tolerable_decay(found.drawn, found.program.depth_mm / 1e3, stiffness_at) if found.stable else 0.0
    remarks = (remark,) if found.stable else ()
    if found.word is Word.STABLE or not found.assembly.is_sure:
        return Advice(decay=decay, remarks=remarks)
    search = SettingSearch.of(found.program, found.drawn, found.assembly, machine, found.at_speed)
    best = search.elsewhere()
    if best is not None:
        return Advice(best, None, decay, remarks)
    here = search.here(1e3 * min(found.limit_low, found.limit / (1 + SPARE)))
    return Advice(search.most_chips() or here, here, decay, remarks)
