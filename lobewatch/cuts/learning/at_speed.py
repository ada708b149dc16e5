"""A program and its spindle at speed, where test cuts have taught it: what verdicts and advice then rest on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from acquisition import DataError, Remark
from lobewatch.cuts.learning.contradicting import contradiction_remarks
from lobewatch.cuts.learning.of_program import Lesson, lesson
from lobewatch.cuts.learning.posterior import Posterior
from lobewatch.machine import CutTable, Machine, ProgramTable
from lobewatch.machine.journal.heard_cut import HeardCut
from lobewatch.tool.assembly import Assembly
from lobewatch.verdicts.doubt import CUTS, Doubt, LearntDraws, Span
from lobewatch.verdicts.drawn import DRAWS, middle_row
from lobewatch.verdicts.spindle_at_speed import AT_REST, SpindleAtSpeed
from lobewatch.verdicts.verdict import Verdict, as_program, judge

Floats = NDArray[np.float64]


def judge_at_speed(
    table: ProgramTable, tool: Assembly | DataError, machine: Machine, cuts: Sequence[HeardCut]
) -> Verdict:
    """The verdict on a program, or why its tool is not known; at speed as far as cuts have taught, else at rest."""
    return judge(table, tool, machine, AT_REST if isinstance(tool, DataError) else at_speed(table, tool, machine, cuts))


def at_speed(table: CutTable, tool: Assembly, machine: Machine, cuts: Sequence[HeardCut]) -> SpindleAtSpeed:
    """What cuts have taught of a program and its spindle; nothing of the reference cut."""
    if not isinstance(table, ProgramTable) or not tool.directions:
        return AT_REST
    if not any(cut.tool == table.tool and cut.counts for cut in cuts):
        return AT_REST
    taught = lesson(table, tool, machine, cuts)
    remarks = tuple(contradiction_remarks(taught.learnt, taught.contradicting, table.name))
    return _learnt(taught, tool, machine, remarks) if taught.learnt.cuts else SpindleAtSpeed(remarks=remarks)


def _learnt(taught: Lesson, tool: Assembly, machine: Machine, remarks: tuple[Remark, ...]) -> SpindleAtSpeed:
    """The middle of what a lesson has left, and the draws around it."""
    rest, draws = middle_row(as_program(taught.program, machine), tool), taught.learnt.sample(DRAWS)
    rows = draws.rows(1.0, float(rest.tangential[0]), float(rest.radial[0]))
    parts = [getattr(rows, name) / getattr(rest, name) for name in ("frequency", "damping_ratio", "stiffness")]
    middle, phases = [np.mean(part, axis=0) for part in parts], rows.phase - rest.phase
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
        cuts=len(taught.learnt.cuts),
        remarks=remarks,
        doubt=Doubt(
            modes={CUTS: _widths(parts, phases)},
            mixing=np.tile(np.eye(4), (rest.direction.size, 1, 1)),
            speed=machine.doubt.speed_percent / 100,
            tangential=_span(force),
            ratio=_span(direction),
            learnt=left,
        ),
        factors=np.stack(middle, axis=1),
        tangential=float(rest.tangential[0]) * push / 1e6,
        radial=float(rest.radial[0]) * push * ratio / 1e6,
        before=_spans(taught.before),
        after=_spans(taught.learnt),
    )


def _widths(parts: Sequence[Floats], turned: Floats) -> Floats:
    """Half-widths of 95 % of frequency, damping ratio, stiffness (relative) and phase (rad), shape (n, 4)."""
    relative = [
        np.diff(np.quantile(part, (0.025, 0.975), axis=0), axis=0)[0] / 2 / np.mean(part, axis=0) for part in parts
    ]
    return np.stack([*relative, np.std(turned, axis=0) * 2], axis=1)


def _spans(posterior: Posterior) -> dict[str, Span]:
    """Intervals of all that is learnt, over the values at rest."""
    return {name: Span(interval.low, interval.high) for name, interval in posterior.intervals.items()}


def _span(values: Floats) -> Span:
    low, high = np.quantile(values, (0.025, 0.975)) / np.mean(values) if np.mean(values) > 0 else (1.0, 1.0)
    return Span(min(float(low), 1.0), max(float(high), 1.0))
