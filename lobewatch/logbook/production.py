"""Next ordinary cuts of a program, from all tap tests, test cuts and power readings of its tool."""

from collections.abc import Sequence
from typing import NamedTuple

from acquisition import DataError
from lobewatch.cuts.learning.production_ladder import MAX_LADDER_CUTS, Ladder, find_ladder
from lobewatch.cuts.learning.program_learning import LearningResult, build_cut_grid, learn_program
from lobewatch.cuts.learning.suggestion import find_best_removal_rate
from lobewatch.logbook.analysis import Analysis
from lobewatch.logbook.logbook import Logbook
from lobewatch.machine import ProgramTable
from lobewatch.machine.journal.entries import CutEntry
from lobewatch.machine.settings.drive_power import CutRange, expected_power
from lobewatch.verdicts.recommendation import Recommendation, find_gap


class ProductionPlan(NamedTuple):
    """Next ordinary cuts of a program."""

    learning: LearningResult
    """Result of the cuts made so far."""
    ladder: Ladder
    """Next cuts."""
    powers_kw: tuple[float | None, ...]
    """Expected power of each next cut (kW); None without a feed per tooth."""
    is_saved: bool
    """True if the program is in machine.toml, so that results can be entered."""


def plan_recommended(logbook: Logbook, answer: Recommendation) -> ProductionPlan | None:
    """Plan the ordinary cuts that follow a recommendation; None if its tool or cut leaves something open."""
    setting = answer.setting
    rate = 0.0 if setting is None else setting.speed_rpm * setting.depth_mm / 1e3
    return _plan(logbook, answer.program, logbook.cuts, rate, MAX_LADDER_CUTS)


def plan_next_cut(logbook: Logbook, program: str | None, cuts: Sequence[CutEntry]) -> ProductionPlan | None:
    """Plan the ordinary cut that follows the newest cut of a program; None without such a program or a tapped tool."""
    table = next((table for table in logbook.machine.program if table.name == program), None)
    return None if table is None else _plan(logbook, table, cuts, 0.0, 1)


def _plan(
    logbook: Logbook, table: ProgramTable, cuts: Sequence[CutEntry], rate: float, count: int
) -> ProductionPlan | None:
    """Plan at most `count` cuts that remove more than a rate (rpm m) and all stable cuts so far."""
    machine, tool = logbook.machine, logbook.query(Analysis.assembly_or_reason, table.tool)
    if isinstance(tool, DataError) or find_gap(table, tool, machine) or CutRange.of(machine, table).is_empty:
        return None
    learning = learn_program(table, tool, machine, cuts)
    rejected = learning.rejected_cuts
    accepted = [cut for cut in learning.own_cuts if cut not in rejected]
    grid, running = build_cut_grid(table, tool, machine), max(rate, find_best_removal_rate(accepted))
    ladder = find_ladder(learning.posterior, grid, learning.own_cuts, rejected, running, count)
    factor = learning.posterior.intervals["tangential"].mean
    powers = [expected_power(machine, table, step.speed_rpm, step.depth, factor) for step in ladder.steps]
    known = tuple(None if power is None else power / 1e3 for power in powers)
    is_saved = any(saved.name == table.name for saved in machine.all_programs)
    return ProductionPlan(learning, ladder, known, is_saved)
