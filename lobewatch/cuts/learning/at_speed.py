"""A program and its spindle at speed, where test cuts have taught it: what verdicts, advice and lobes then rest on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from acquisition import DataError, Remark
from lobes import StabilityLobes
from lobewatch.cuts.learning.contradicting import contradiction_remarks
from lobewatch.cuts.learning.heard_depth import with_heard_word
from lobewatch.cuts.learning.lesson import Lesson, learn_program
from lobewatch.cuts.learning.posterior import Posterior
from lobewatch.machine import CutTable, Machine, ProgramTable
from lobewatch.machine.journal.heard_cut import HeardCut
from lobewatch.tool.assembly import Assembly, tip_lobes
from lobewatch.verdicts.doubt import CUTS, Doubt, LearntDraws, Span
from lobewatch.verdicts.draws import DRAWS, as_program, middle_row
from lobewatch.verdicts.limit_band import LimitBand, limit_band
from lobewatch.verdicts.spindle_at_speed import AT_REST, SpindleAtSpeed
from lobewatch.verdicts.verdict import Verdict, judge

ENDS = (0.025, 0.975)
"""Quantiles that 95 % of draws lie between."""

Floats = NDArray[np.float64]


def judge_at_speed(
    table: ProgramTable, tool: Assembly | DataError, machine: Machine, cuts: Sequence[HeardCut]
) -> Verdict:
    """The verdict on a program, or why its tool is not known; at speed as far as cuts have taught, else at rest."""
    learnt = AT_REST if isinstance(tool, DataError) else spindle_at_speed(table, tool, machine, cuts)
    verdict = judge(table, tool, machine, learnt)
    if isinstance(tool, DataError) or tool.directions or not tool.unweighed:
        return verdict
    return with_heard_word(verdict, tool, machine, cuts)


def spindle_at_speed(table: CutTable, tool: Assembly, machine: Machine, cuts: Sequence[HeardCut]) -> SpindleAtSpeed:
    """What cuts have taught of a program and its spindle; nothing of the reference cut."""
    if not isinstance(table, ProgramTable) or not tool.directions:
        return AT_REST
    if not any(cut.tool == table.tool and cut.counts for cut in cuts):
        return AT_REST
    lesson = learn_program(table, tool, machine, cuts)
    remarks = tuple(contradiction_remarks(lesson.learnt, lesson.contradicting, table.name))
    return _learnt(lesson, tool, machine, remarks) if lesson.believed else SpindleAtSpeed(remarks=remarks)


def _learnt(lesson: Lesson, tool: Assembly, machine: Machine, remarks: tuple[Remark, ...]) -> SpindleAtSpeed:
    """The middle of what a lesson has left, and the draws around it."""
    at_rest, draws = middle_row(as_program(lesson.program, machine), tool), lesson.learnt.sample(DRAWS)
    rows = draws.rows(1.0, float(at_rest.tangential[0]), float(at_rest.radial[0]))
    parts = [getattr(rows, name) / getattr(at_rest, name) for name in ("frequency", "damping_ratio", "stiffness")]
    middle, phases = [np.mean(part, axis=0) for part in parts], rows.phase - at_rest.phase
    force, direction = (draws.ratios()[name] for name in ("tangential", "ratio"))
    push, ratio = float(np.mean(force)), float(np.mean(direction))
    left = LearntDraws(
        frequency=parts[0] / middle[0],
        damping_ratio=parts[1] / middle[1],
        stiffness=parts[2] / middle[2],
        turned=phases,
        force=force / np.mean(force),
        direction=direction / np.mean(direction) if np.all(direction > 0) else np.ones(direction.shape),
    )
    return SpindleAtSpeed(
        cuts=len(lesson.believed),
        remarks=remarks,
        doubt=Doubt(
            modes={CUTS: _widths(parts, phases)},
            mixing=np.tile(np.eye(4), (at_rest.direction.size, 1, 1)),
            speed=machine.doubt.speed_percent / 100,
            tangential=_span(force),
            ratio=_span(direction),
            axes=tool.axes,
            learnt=left,
        ),
        factors=np.stack(middle, axis=1),
        tangential=float(at_rest.tangential[0]) * push / 1e6,
        radial=float(at_rest.radial[0]) * push * ratio / 1e6,
        before=_spans(lesson.before),
        after=_spans(lesson.learnt),
    )


def _widths(parts: Sequence[Floats], turned: Floats) -> Floats:
    """Half-widths of 95 % of frequency, damping ratio, stiffness (relative) and phase (rad), shape (n, 4)."""
    relative = [np.diff(np.quantile(part, ENDS, axis=0), axis=0)[0] / 2 / np.mean(part, axis=0) for part in parts]
    return np.stack([*relative, np.std(turned, axis=0) * 2], axis=1)


def _spans(posterior: Posterior) -> dict[str, Span]:
    """Intervals of all that is learnt, over the values at rest."""
    return {name: Span(interval.low, interval.high) for name, interval in posterior.intervals.items()}


def _span(values: Floats) -> Span:
    """95 % of some draws over their mean."""
    low, high = np.quantile(values, ENDS) / np.mean(values) if np.mean(values) > 0 else (1.0, 1.0)
    return Span(min(float(low), 1.0), max(float(high), 1.0))


class LobesAtSpeed(NamedTuple):
    """Lobes of a cut by zero order with the spindle at speed."""

    cuts: int
    """Number of test cuts that they were learnt from."""
    lobes: StabilityLobes
    """Lobes in the middle of what was learnt."""
    band: LimitBand
    """Band of the limits that the cuts have left open."""


def lobes_at_speed(verdicts: Sequence[Verdict], machine: Machine) -> LobesAtSpeed | None:
    """The lobes of programs with the same cut, from their verdicts; None where no test cut has taught anything."""
    for verdict in verdicts:
        tool, name, at_speed = verdict.assembly, verdict.program.name, verdict.at_speed
        if tool is None or not at_speed.cuts:
            continue
        taught, spindle = msgspec.structs.replace(machine, listed=(verdict.program,)), at_speed.moved(tool)
        lobes = tip_lobes(spindle.tool, spindle.x, spindle.y, taught, [name], spindle.cross)[name]
        return LobesAtSpeed(at_speed.cuts, lobes, limit_band(lobes, name, tool, taught, at_speed))
    return None
