"""Next ordinary cuts of a program, from all tap tests, test cuts and power readings of its tool."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from acquisition import DataError
from lobewatch.cuts.learning.cut_likelihood import estimate_force_by_power
from lobewatch.cuts.learning.production_ladder import MAX_LADDER_CUTS, Ladder, find_ladder
from lobewatch.cuts.learning.program_learning import LearningResult, build_cut_grid, learn_program
from lobewatch.cuts.learning.suggestion import CutGrid
from lobewatch.logbook.analysis import Analysis
from lobewatch.logbook.logbook import Logbook
from lobewatch.machine import Machine, ProgramTable
from lobewatch.machine.journal.entries import CutEntry
from lobewatch.machine.settings.drive_power import DEPTH_STEP_MM, CutRange, predict_power
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
    running = None if setting is None else (setting.speed_rpm, setting.depth_mm / 1e3)
    return _plan(logbook, answer.program, logbook.cuts, running, MAX_LADDER_CUTS)


def plan_next_cut(logbook: Logbook, program: str | None, cuts: Sequence[CutEntry]) -> ProductionPlan | None:
    """Plan the ordinary cut that follows the newest cut of a program; None without such a program or a tapped tool."""
    table = next((table for table in logbook.machine.program if table.name == program), None)
    return None if table is None else _plan(logbook, table, cuts, None, 1)


def _plan(
    logbook: Logbook, table: ProgramTable, cuts: Sequence[CutEntry], running: tuple[float, float] | None, count: int
) -> ProductionPlan | None:
    """Plan at most `count` cuts that remove more than a running one (rpm, m) and all stable cuts so far."""
    machine, tool = logbook.machine, logbook.query(Analysis.assembly_or_reason, table.tool)
    if isinstance(tool, DataError) or find_gap(table, tool, machine) or CutRange.of(machine, table).is_empty:
        return None
    learning = learn_program(table, tool, machine, cuts)
    ladder = climb(learning, build_cut_grid(table, tool, machine), machine, running, count)
    factor = learning.posterior.intervals["tangential"].mean
    powers = [predict_power(machine, table, step.speed_rpm, step.depth) for step in ladder.steps]
    known = tuple(None if power is None else factor * power.watts / 1e3 for power in powers)
    is_saved = any(saved.name == table.name for saved in machine.all_programs)
    return ProductionPlan(learning, ladder, known, is_saved)


def climb(
    learning: LearningResult,
    grid: CutGrid,
    machine: Machine,
    running: tuple[float, float] | None = None,
    count: int = MAX_LADDER_CUTS,
) -> Ladder:
    """Find the next ordinary cuts of a program from its posterior.

    Parameters
    ----------
    learning
        Result of the cuts made so far.
    grid
        Possible cuts.
    machine
        Machine of the program.
    running
        Speed (rpm) and depth (m) of the cut that runs now, unless a stable cut so far removes more.
    count
        Largest number of cuts.
    """
    rejected, own = learning.rejected_cuts, learning.own_cuts
    made = [(cut.speed_rpm, cut.depth) for cut in own if not cut.has_chatter and cut not in rejected]
    best = max([*made, *([running] if running else [])], key=math.prod, default=None)
    shown = predict_power(machine, learning.program, grid.speeds[0], DEPTH_STEP_MM / 1e3)
    power = None if shown is None else estimate_force_by_power(shown, grid.cut, chatters=False)
    return find_ladder(learning.posterior, grid, own, rejected, best, count, power)
