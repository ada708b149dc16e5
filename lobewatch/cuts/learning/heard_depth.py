"""Depths that test cuts alone tell, where no force was measured and no limit can be computed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from acquisition import Remark
from lobewatch.cuts.learning.cut_evidence import CutEvidence
from lobewatch.cuts.learning.lesson import tool_evidence
from lobewatch.machine import Machine, ProgramTable
from lobewatch.machine.journal.heard_cut import HeardCut, geometry
from lobewatch.machine.settings.cut_range import MM, RPM, CutRange, floored_mm
from lobewatch.tool.assembly import Assembly
from lobewatch.verdicts.speed_pockets import SpeedPocket, speed_pockets
from lobewatch.verdicts.verdict import NOT_CHECKED, Verdict, Word

CUTS = 5
"""Number of test cuts in a pocket after which its depth stands."""
FIRST = 0.25
"""First depth over that of the program."""
CLOSE = 1.2
"""Shallowest depth with chatter over the deepest without, below which no cut between them is worth making."""
SAME_SPEED = 0.01
"""Relative distance of two speeds that are one."""


@dataclass(frozen=True)
class HeardDepth:
    """A pocket with what was heard in it."""

    pocket: SpeedPocket
    """Pocket by f_n and damping."""
    speed_rpm: float
    """Speed to cut at (rpm), the middle of its window."""
    cuts: tuple[CutEvidence, ...]
    """Cuts of the same cutter, material and immersion in its window."""
    deepest: float
    """Deepest cut that machine and tool bear there (m)."""

    @property
    def chatters_at(self) -> float:
        """Shallowest depth that chattered (m); inf where none did."""
        return min((cut.depth for cut in self.cuts if cut.chatters), default=math.inf)

    @property
    def depth(self) -> float:
        """Deepest depth that was heard stable, shallower than all chatter (m); 0 where none was."""
        stable = (cut.depth for cut in self.cuts if not cut.chatters)
        return max((depth for depth in stable if depth < self.chatters_at), default=0.0)

    def next_depth(self, first: float) -> float | None:
        """Depth of the next cut (m), twice as deep or between what was heard; None where none is worth making.

        first: depth to begin with (m).
        """
        if len(self.cuts) >= CUTS:
            return None
        if not self.depth:
            wanted = first if math.isinf(self.chatters_at) else self.chatters_at / 2
        elif math.isinf(self.chatters_at):
            wanted = 2 * self.depth
        else:
            wanted = math.sqrt(self.depth * self.chatters_at) if self.chatters_at > CLOSE * self.depth else self.depth
        wanted = floored_mm(1e3 * min(wanted, self.deepest)) / 1e3
        return wanted if wanted > self.depth else None


def heard_depths(
    table: ProgramTable, assembly: Assembly, machine: Machine, cuts: Sequence[HeardCut]
) -> list[HeardDepth]:
    """The best pockets of a program with what was heard in each, that nearest to its own speed first."""
    own, reach = _own_cuts(table, assembly, machine, cuts), CutRange.of(machine, table)
    told = []
    for pocket in speed_pockets(table, assembly, machine):
        speed = round(sum(pocket.window_rpm) / 2 / RPM) * RPM
        inside = tuple(cut for cut in own if pocket.holds(cut.speed_rpm))
        told.append(HeardDepth(pocket, speed, inside, float(reach.depths(np.array([speed]))[0]) / 1e3))
    return sorted(told, key=lambda heard: abs(math.log(heard.speed_rpm / table.speed_rpm)))


def first_depth(table: ProgramTable) -> float:
    """Depth of the first cut (m): a part of that of the program."""
    return max(floored_mm(FIRST * table.depth_mm), MM) / 1e3


def with_heard_word(verdict: Verdict, assembly: Assembly, machine: Machine, cuts: Sequence[HeardCut]) -> Verdict:
    """A verdict on a program whose limit is not known, with the word of the cuts that were heard at its very speed:
    doubtful at best, for they tell nothing of what is not known."""
    program = verdict.program
    at_speed = [
        cut
        for cut in _own_cuts(program, assembly, machine, cuts)
        if abs(cut.speed_rpm / program.speed_rpm - 1) <= SAME_SPEED
    ]
    depth = program.depth_mm / 1e3
    chattering = [cut for cut in at_speed if cut.chatters and cut.depth <= depth]
    stable = [cut for cut in at_speed if not cut.chatters and cut.depth >= depth]
    if not chattering and not stable:
        return verdict
    heard = (chattering or stable)[-1]
    word, what = (Word.NOT_STABLE, "chatter") if chattering else (Word.DOUBTFUL, "stable")
    text = f"cut {heard.id} was heard {what} at {1e3 * heard.depth:.4g} mm; without K no limit is known beside it"
    remark = Remark("heard-alone", program.name, text, "tap with a hammer that measures its force")
    others = [other for other in verdict.remarks if other.code != NOT_CHECKED]
    return replace(verdict, word=word, remarks=(remark, *others))


def _own_cuts(table: ProgramTable, assembly: Assembly, machine: Machine, cuts: Sequence[HeardCut]) -> list[CutEvidence]:
    """Cuts of this very program, at the speeds that are now what theirs were then: f_n may have moved since."""
    shape = geometry(machine.build_cut(table))
    evidence = tool_evidence(cuts, table, assembly, machine)
    own = [cut for cut in evidence if cut.material == 0 and geometry(cut.cut) == shape]
    return [replace(cut, speed_rpm=cut.speed_rpm / cut.moved) for cut in own]
