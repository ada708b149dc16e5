"""What the test cuts of a machine say of one of its programs, and which cut to make next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from lobewatch.cuts.learning.contradicting import (
    ContradictingCut,
    Contradiction,
    contradictions,
    contradicts_by_power,
)
from lobewatch.cuts.learning.cut_evidence import CutEvidence
from lobewatch.cuts.learning.force_by_power import force_by_power
from lobewatch.cuts.learning.grid import STEP, Grid, zero_order_trust
from lobewatch.cuts.learning.posterior import Posterior, prior
from lobewatch.cuts.learning.suggest import Suggestion, suggest
from lobewatch.machine import Machine, ProgramTable
from lobewatch.machine.journal.heard_cut import HeardCut, geometry
from lobewatch.machine.settings.cut_range import CutRange
from lobewatch.machine.settings.cut_setting import find_named
from lobewatch.machine.settings.cut_tables import FEED_ANGLES
from lobewatch.tool.assembly import Assembly
from lobewatch.tool.series import frequency_at
from lobewatch.verdicts.doubt import doubt_of
from lobewatch.verdicts.draws import as_program, middle_row


@dataclass(frozen=True, eq=False)
class Lesson:
    """What was learnt for one program."""

    program: ProgramTable
    """Program as it stands in machine.toml."""
    before: Posterior
    """Spindle and coefficients as known without any cut."""
    learnt: Posterior
    """Spindle and coefficients as known with the cuts."""
    contradicting: tuple[ContradictingCut, ...]
    """Cuts that are not believed; of some it is their power alone, without which they were learnt from."""
    own_cuts: tuple[CutEvidence, ...]
    """Cuts of this very program, in its material and of its geometry, at whatever speed and depth."""

    @property
    def doubted(self) -> tuple[CutEvidence, ...]:
        """Cuts whose word is not believed."""
        return tuple(odd.cut for odd in self.contradicting if odd.why is not Contradiction.POWER)

    @property
    def believed(self) -> tuple[CutEvidence, ...]:
        """Cuts that are."""
        return tuple(cut for cut in self.learnt.cuts if cut not in self.doubted)


@dataclass(frozen=True, eq=False)
class NextCut:
    """What to cut next, and what it rests on."""

    lesson: Lesson
    """Lesson of the cuts that were made."""
    suggested: Suggestion | None
    """Cut to make; None where nothing more is to be gained, or all cuts are made."""
    left: int
    """Number of test cuts that are still to be made."""
    reach: CutRange
    """Speeds and depths that machine and tool bear."""


def find_program(machine: Machine, name: str) -> ProgramTable:
    """A program of machine.toml, by its name or how that begins; ValueError for one that is not there."""
    return find_named({table.name: table for table in machine.program}, name)


def learn_program(table: ProgramTable, assembly: Assembly, machine: Machine, cuts: Sequence[HeardCut]) -> Lesson:
    """Learn from the cuts of a machine; those of other tools say nothing of this one."""
    start = prior(middle_row(as_program(table, machine), assembly), doubt_of(assembly, table, machine))
    learnt, odd_powers = start, []
    for cut in tool_evidence(cuts, table, assembly, machine):
        evidence = learnt.predict(cut)
        if contradicts_by_power(evidence):
            odd_powers.append(ContradictingCut(cut, Contradiction.POWER))
            evidence = replace(evidence, cut=replace(cut, power=None))
        learnt = evidence.learn()
    shape = geometry(machine.build_cut(table))
    own_cuts = tuple(cut for cut in learnt.cuts if cut.material == 0 and geometry(cut.cut) == shape)
    return Lesson(table, start, learnt, (*contradictions(learnt), *odd_powers), own_cuts)


def next_cut(table: ProgramTable, assembly: Assembly, machine: Machine, cuts: Sequence[HeardCut], most: int) -> NextCut:
    """The next test cut of a program of which so many shall be made at most."""
    lesson = learn_program(table, assembly, machine, cuts)
    left = max(most - len(lesson.own_cuts), 0)
    reach = CutRange.of(machine, table)
    if not left or reach.is_empty:
        return NextCut(lesson, None, left, reach)
    grid = grid_of(table, assembly, machine)
    cut = suggest(lesson.learnt, grid, lesson.own_cuts, left, lesson.doubted, table.depth_mm / 1e3)
    return NextCut(lesson, cut, left, reach)


def grid_of(table: ProgramTable, assembly: Assembly, machine: Machine) -> Grid:
    """Speeds of the machine, and depths that tool and drive allow."""
    reach = CutRange.of(machine, table)
    speeds = reach.speeds(STEP)
    deepest = reach.depths(speeds) / 1e3
    cut, angles = machine.build_cut(table), tuple(FEED_ANGLES[feed] for feed in table.feeds)
    trust = zero_order_trust(assembly.x, assembly.y, cut, angles, speeds, reach.deepest_mm / 1e3)
    return Grid(cut, angles, speeds, deepest, trust)


def tool_evidence(
    cuts: Sequence[HeardCut], table: ProgramTable, assembly: Assembly, machine: Machine
) -> tuple[CutEvidence, ...]:
    """The cuts of the same tool that count, oldest first."""
    known = machine.coefficients(table)
    materials = [(known.material, known.tangential, known.radial)]
    evidence = []
    for heard in cuts:
        if heard.tool != table.tool or not heard.counts:
            continue
        material = heard.coefficients, heard.cut.tangential, heard.cut.radial
        if material not in materials:
            materials.append(material)
        evidence.append(_evidence(heard, materials.index(material), assembly))
    return tuple(evidence)


def _evidence(cut: HeardCut, material: int, assembly: Assembly) -> CutEvidence:
    feeds = FEED_ANGLES if cut.feed == "both" else (cut.feed,)
    return CutEvidence(
        cut=cut.cut,
        speed_rpm=cut.speed_rpm,
        depth=cut.depth,
        word=cut.word,
        frequency=float("nan") if cut.chatter_frequency_hz is None else cut.chatter_frequency_hz,
        feed_angles=tuple(FEED_ANGLES[feed] for feed in feeds),
        material=material,
        speed_found=cut.by != "ear",
        moved=_moved(cut, assembly),
        id=cut.id,
        power=None if cut.power is None else force_by_power(cut.power, cut.cut, cut.chatters),
    )


def _moved(cut: HeardCut, assembly: Assembly) -> float:
    """Natural frequency when a cut was made over that of now, in the mean of the directions; 1 where not known."""
    pairs = [(frequency_at(series, cut.at), series[-1].frequency) for series in assembly.series.values() if series]
    ratios = [before / now for before, now in pairs if before is not None]
    return float(np.mean(ratios)) if ratios else 1.0
