"""A program and its spindle at speed, where test cuts have taught it: what verdicts and advice then rest on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from acquisition import DataError
from lobes import MillingRows
from lobewatch.cuts.learning.contradicting import remarks_on
from lobewatch.cuts.learning.learnt import Interval
from lobewatch.cuts.learning.of_program import Lesson, lesson
from lobewatch.machine import CutTable, Machine, ProgramTable
from lobewatch.machine.journal.heard_cut import HeardCut
from lobewatch.tool.assembly import Assembly, Modes
from lobewatch.verdicts.doubt import LEAST, Doubt, Span
from lobewatch.verdicts.drawn import DRAWS, middle_row
from lobewatch.verdicts.verdict import Verdict, as_program, judge

Table = TypeVar("Table", bound=CutTable)
Floats = NDArray[np.float64]
CAUSE = "cuts"
"""What the doubt of the modes comes from: all that the cuts have left open."""


@dataclass(frozen=True, eq=False)
class LearntDoubt(Doubt):
    """What cuts have left open; its draws are those that explain them, around their mean."""

    frequency: Floats
    """Over their mean, shape (r, n), as the next two."""
    damping_ratio: Floats
    stiffness: Floats
    turned: Floats
    """Phases less those of the middle (rad), shape (r, n)."""
    force: Floats
    """Kt over its mean, shape (r,)."""
    direction: Floats
    """Kr/Kt over its mean, shape (r,)."""
    before: dict[str, Interval]
    """What was known before the cuts, by name (`Draws.ratios`) ..."""
    after: dict[str, Interval]
    """... and what is known with them."""

    def draw(self, middle: MillingRows, count: int, seed: int = 0, without: str = "") -> MillingRows:
        """Systems that explain the cuts (count rows) around one (a row); speeds as the machine may be off."""
        take = np.arange(count) % len(self.force)
        rows, spindle = middle[np.zeros(count, dtype=np.intp)], float(without != CAUSE)
        speed = 1 + self.speed * np.random.default_rng(seed).uniform(-1, 1, count) * (without != "speed")
        push, ratio = (1 + (one[take] - 1) * (without != "coefficients") for one in (self.force, self.direction))
        return replace(
            rows,
            frequency=rows.frequency * (1 + (self.frequency[take] - 1) * spindle),
            damping_ratio=rows.damping_ratio * (1 + (self.damping_ratio[take] - 1) * spindle),
            stiffness=rows.stiffness * (1 + (self.stiffness[take] - 1) * spindle),
            phase=rows.phase + self.turned[take] * spindle,
            speed_rpm=rows.speed_rpm * np.maximum(speed, LEAST),
            tangential=rows.tangential * push,
            radial=rows.radial * push * ratio,
        )


def judge_at_speed(
    table: ProgramTable, known: Assembly | DataError, machine: Machine, cuts: Sequence[HeardCut]
) -> Verdict:
    """The verdict on a program, or why its tool is not known; at speed as far as cuts have taught, else at rest."""
    if isinstance(known, DataError):
        return judge(table, known, machine)
    taught, assembly = at_speed(table, known, machine, cuts)
    return judge(taught, assembly, machine)


def at_speed(
    table: Table, known: Assembly, machine: Machine, cuts: Sequence[HeardCut]
) -> tuple[Table | ProgramTable, Assembly]:
    """A program and its tool, in the middle of what cuts have taught; as they were where none has taught anything."""
    if not isinstance(table, ProgramTable) or not known.directions:
        return table, known
    if not any(cut.tool == table.tool and cut.counts for cut in cuts):
        return table, known
    found = lesson(table, known, machine, cuts)
    remarks = (*known.remarks, *remarks_on(found.learnt, found.contradicting, table.name))
    if not found.learnt.cuts:
        return table, replace(known, remarks=remarks)
    return _taught(found, replace(known, remarks=remarks, cuts=len(found.learnt.cuts)), machine)


def _taught(found: Lesson, known: Assembly, machine: Machine) -> tuple[ProgramTable, Assembly]:
    table, rest = found.program, middle_row(as_program(found.program, machine), known)
    draws = found.learnt.sample(DRAWS)
    rows = draws.rows(1.0, float(rest.tangential[0]), float(rest.radial[0]))
    parts = [getattr(rows, name) / getattr(rest, name) for name in ("frequency", "damping_ratio", "stiffness")]
    middle = [np.mean(part, axis=0) for part in parts]
    force, direction = (draws.ratios()[name] for name in ("tangential", "ratio"))
    doubt = LearntDoubt(
        modes={CAUSE: _widths(parts, rows.phase - rest.phase)},
        mixing=np.tile(np.eye(4), (rest.direction.size, 1, 1)),
        speed=machine.doubt.speed_percent / 100,
        tangential=_span(force),
        ratio=_span(direction),
        frequency=parts[0] / middle[0],
        damping_ratio=parts[1] / middle[1],
        stiffness=parts[2] / middle[2],
        turned=rows.phase - rest.phase,
        force=force / np.mean(force),
        direction=direction / np.mean(direction) if np.all(direction > 0) else np.ones(direction.shape),
        before=found.before.intervals,
        after=found.learnt.intervals,
    )
    push, turned = float(np.mean(force)), float(np.mean(direction))
    moved = msgspec.structs.replace(
        table,
        material=None,
        tangential_n_per_mm2=float(rest.tangential[0]) * push / 1e6,
        radial_n_per_mm2=float(rest.radial[0]) * push * turned / 1e6,
    )
    scaled = np.stack(middle, axis=1)
    count = len(known.x or ())
    x, y = _moved(known.x, scaled[:count]), _moved(known.y, scaled[count:])
    return moved, replace(known, x=x, y=y, doubt=doubt)


def _moved(modes: Modes, factors: Floats) -> Modes:
    """Modes with frequency, damping ratio and stiffness times these (n, 3)."""
    return modes and [
        replace(
            mode,
            frequency=mode.frequency * f,
            damping_ratio=mode.damping_ratio * zeta,
            stiffness=mode.stiffness * k,
            covariance=None,
            jackknife=None,
            n_hits=0,
        )
        for mode, (f, zeta, k) in zip(modes, factors.tolist(), strict=True)
    ]


def _widths(parts: Sequence[Floats], turned: Floats) -> Floats:
    """Half-widths of 95 % of frequency, damping ratio, stiffness (relative) and phase (rad), shape (n, 4)."""
    relative = [
        np.diff(np.quantile(part, (0.025, 0.975), axis=0), axis=0)[0] / 2 / np.mean(part, axis=0) for part in parts
    ]
    return np.stack([*relative, np.std(turned, axis=0) * 2], axis=1)


def _span(values: Floats) -> Span:
    low, high = np.quantile(values, (0.025, 0.975)) / np.mean(values) if np.mean(values) > 0 else (1.0, 1.0)
    return Span(min(float(low), 1.0), max(float(high), 1.0))
