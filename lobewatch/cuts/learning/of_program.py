"""What the test cuts of a machine say of one of its programs, and which cut to make next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lobewatch.cuts.learning.contradicting import ContradictingCut, learn_from_consistent
from lobewatch.cuts.learning.cut_evidence import CutEvidence
from lobewatch.cuts.learning.grid import Grid, speeds_between, zero_order_trust
from lobewatch.cuts.learning.posterior import Posterior, prior
from lobewatch.cuts.learning.suggest import Suggestion, best_removal_rate, suggest
from lobewatch.machine import Machine, ProgramTable, drive_limit
from lobewatch.machine.journal.heard_cut import HeardCut, geometry
from lobewatch.machine.settings.cut_setting import find_named
from lobewatch.machine.settings.cut_tables import FEED_ANGLES
from lobewatch.tool.assembly import Assembly
from lobewatch.tool.series import frequency_at
from lobewatch.verdicts.doubt import doubt_of
from lobewatch.verdicts.drawn import middle_row
from lobewatch.verdicts.verdict import as_program


@dataclass(frozen=True, eq=False)
class Lesson:
    """What was learnt for one program."""

    program: ProgramTable
    before: Posterior
    """What is known without any cut."""
    learnt: Posterior
    """What is known with them."""
    contradicting: tuple[ContradictingCut, ...]
    """Cuts that were left out."""
    own: tuple[CutEvidence, ...]
    """Those that were cuts of this very program, at whatever speed and depth."""


@dataclass(frozen=True, eq=False)
class NextCut:
    """What to cut next, and what it rests on."""

    lesson: Lesson
    suggested: Suggestion | None
    """None where nothing more is to be gained, or all cuts are made."""
    left: int
    """Test cuts that are still to be made."""

    @property
    def best(self) -> float:
        """Largest speed times depth that was heard stable (rpm m); 0 where none was."""
        return best_removal_rate(self.lesson.own)


def program_named(machine: Machine, name: str) -> ProgramTable:
    """A program of machine.toml, by its name or how that begins; ValueError for one that is not there."""
    return find_named({table.name: table for table in machine.program}, name)


def lesson(table: ProgramTable, assembly: Assembly, machine: Machine, cuts: Sequence[HeardCut]) -> Lesson:
    """Learn from the cuts of a machine; those of other tools say nothing of this one."""
    seen = observed(cuts, table, assembly, machine)
    start = prior(middle_row(as_program(table, machine), assembly), doubt_of(assembly, table, machine))
    learnt, odd = learn_from_consistent(start, seen)
    cut = geometry(machine.build_cut(table))
    own = tuple(one for one in seen if one.material == 0 and geometry(one.cut) == cut)
    return Lesson(table, start, learnt, odd, own)


def next_cut(table: ProgramTable, assembly: Assembly, machine: Machine, cuts: Sequence[HeardCut], most: int) -> NextCut:
    """The next test cut of a program of which so many shall be made at most."""
    found = lesson(table, assembly, machine, cuts)
    left = max(most - len(found.own), 0)
    sound = [one for one in found.own if one not in {odd.cut for odd in found.contradicting}]
    suggested = suggest(found.learnt, grid_of(table, assembly, machine), sound, left) if left else None
    return NextCut(found, suggested, left)


def grid_of(table: ProgramTable, assembly: Assembly, machine: Machine) -> Grid:
    """Speeds of the machine, and depths that tool and drive allow."""
    speeds = speeds_between(machine.speed.low_rpm, machine.speed.high_rpm)
    deepest = np.minimum(table.deepest_mm / 1e3, drive_limit(machine, table, speeds))
    cut, angles = machine.build_cut(table), tuple(FEED_ANGLES[feed] for feed in table.feeds)
    trust = zero_order_trust(assembly.x, assembly.y, cut, angles, speeds, table.deepest_mm / 1e3)
    return Grid(cut, angles, speeds, deepest, trust)


def observed(
    cuts: Sequence[HeardCut], table: ProgramTable, assembly: Assembly, machine: Machine
) -> tuple[CutEvidence, ...]:
    """The cuts of the same tool that count, oldest first."""
    own = table.material or "", machine.build_cut(table).tangential, machine.build_cut(table).radial
    materials = [own]
    found = []
    for cut in cuts:
        if cut.tool != table.tool or not cut.counts:
            continue
        made_of = cut.coefficients, cut.cut.tangential, cut.cut.radial
        if made_of not in materials:
            materials.append(made_of)
        found.append(_observed(cut, materials.index(made_of), assembly))
    return tuple(found)


def _observed(cut: HeardCut, material: int, assembly: Assembly) -> CutEvidence:
    feeds = FEED_ANGLES if cut.feed == "both" else (cut.feed,)
    return CutEvidence(
        cut=cut.cut,
        speed_rpm=cut.speed_rpm,
        depth=cut.depth,
        word=cut.word,
        frequency=float("nan") if cut.chatter_frequency_hz is None else cut.chatter_frequency_hz,
        feed_angles=tuple(FEED_ANGLES[feed] for feed in feeds),
        material=material,
        speed_found=cut.by == "accelerometer",
        moved=_moved(cut, assembly),
        id=cut.id,
    )


def _moved(cut: HeardCut, assembly: Assembly) -> float:
    """Natural frequency when a cut was made over that of now, in the mean of the directions; 1 where not known."""
    then = [(frequency_at(series, cut.at), series[-1].frequency) for series in assembly.series.values() if series]
    ratios = [before / now for before, now in then if before is not None]
    return float(np.mean(ratios)) if ratios else 1.0
