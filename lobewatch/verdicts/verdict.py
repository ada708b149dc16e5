"""The verdict on a cutting program: the one place that says whether it is stable, how surely, and how far."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from acquisition import DataError, Remark
from lobes import Program, ProgramLimit, program_limit
from lobewatch.machine import Machine, ProgramTable, drive_limit
from lobewatch.tool.assembly import ABOUT_DIRECTIONS, Assembly
from lobewatch.verdicts.doubt import doubt_of
from lobewatch.verdicts.drawn import DRAWS, Drawn, draw, middle_row, turning
from lobewatch.verdicts.drawn_limits import drawn_limits
from lobewatch.verdicts.settling import decisive, settles
from lobewatch.verdicts.spindle_at_speed import AT_REST, SpindleAtSpeed

QUANTILES = (0.01, 0.99)
"""Of the limit over the doubt."""
SURELY = 1.15
"""A direction of feed is looked at unless its limit, were it as doubtful as the lowest, left this much to spare."""


class Word(StrEnum):
    """What is said of a program."""

    STABLE = "stable"
    """At most 1 % of the doubt chatters, at 95 % confidence."""
    DOUBTFUL = "doubtful"
    """Stable in the middle, but more of the doubt may chatter; a remark says what decides and what would settle it."""
    NOT_STABLE = "not stable"
    """It chatters in the middle of the doubt."""
    UNKNOWN = "unknown"
    """It could not be checked; a remark says why."""


class CriticalFall(NamedTuple):
    """Falls of the frequency of today, relative; 0 where the word has changed already, inf where none changes it."""

    doubtful: float
    """Up to which it stays stable; NaN where it could not be checked."""
    not_stable: float
    """Up to which it stays stable in the middle of the doubt; NaN where it could not be checked."""
    error: float
    """Standard error of the latter, by damping and stiffness as they scatter from tap test to tap test."""


class Ruling(NamedTuple):
    """What the history keeps of a verdict."""

    word: Word
    """See Word."""
    limit: float
    """Deepest stable depth at the program's speed in the middle of the doubt (m); NaN where it is not known."""
    critical: CriticalFall | None = None
    """How far the frequency may fall; None where nobody has asked yet."""

    @property
    def stable(self) -> bool | None:
        """In the middle of the doubt; None where it is unknown."""
        return None if self.word is Word.UNKNOWN else self.word is not Word.NOT_STABLE


@dataclass(frozen=True, eq=False)
class Verdict:
    """Whether a program is stable with a tool in the spindle as it is known at some time."""

    program: ProgramTable
    """Program as it stands in machine.toml, with the cutting coefficients that test cuts have taught."""
    word: Word
    """See Word."""
    assembly: Assembly | None = None
    """Tool as tapped that it was checked with; None where there is nothing to check with."""
    at_speed: SpindleAtSpeed = AT_REST
    """What test cuts have taught beside it."""
    limit: float = math.nan
    """Deepest stable depth at its speed in the middle of the doubt, in the worst direction of feed (m); inf where there
    is none up to 20 times its own, NaN where unknown."""
    limit_low: float = math.nan
    """1 % quantile of the limit over the doubt (m)."""
    limit_high: float = math.nan
    """99 % quantile (m)."""
    chance_turning: float = math.nan
    """Chance of chatter with the spindle turning, under plausible differences between rest and cut, or those learnt."""
    decided_by: str = ""
    """Cause of the doubt that decides (`Doubt.causes`), "question" where a tap test is in question; empty unless it is
    doubtful."""
    chatter_frequency: float = math.nan
    """Frequency that is heard at the limit (Hz); NaN where there is none."""
    kind: str = ""
    """"hopf", "flip" or ""."""
    feed_angle: float = math.nan
    """Direction of feed that is worst, as an angle from x (rad)."""
    method: str = ""
    """How the limit was found."""
    detail: str = ""
    """How finely."""
    drive_limit: float = math.inf
    """Deepest cut that power and torque allow at its speed (m); inf where no limit is known."""
    drawn: Drawn | None = None
    """The spindles that it was judged on; None where it is unknown."""
    remarks: tuple[Remark, ...] = ()
    """What it rests on, what would settle it, and why it is unknown."""

    @property
    def stable(self) -> bool | None:
        """In the middle of the doubt; None where it is unknown."""
        return self.ruling.stable

    @property
    def measured(self) -> bool:
        """Whether its tool was tapped; else all is predicted by the model, or unknown."""
        return self.assembly is not None and not self.assembly.predicted

    @property
    def cuts(self) -> int:
        """Number of test cuts that it rests on; 0 where it holds for the spindle at rest."""
        return self.at_speed.cuts

    @property
    def depth_margin(self) -> float:
        """Limit in the middle over depth, less 1; negative where it is not stable."""
        return self.limit / (self.program.depth_mm / 1e3) - 1

    @property
    def is_beyond_drive(self) -> bool:
        """Whether it asks for more power or torque than there is."""
        return self.program.depth_mm / 1e3 > self.drive_limit

    @property
    def ruling(self) -> Ruling:
        """What the history keeps."""
        return Ruling(self.word, self.limit)


class Judgement(NamedTuple):
    """The word on a program and what it rests on."""

    word: Word
    """See Word."""
    middle: ProgramLimit
    """Limit in the middle of the doubt."""
    low: float
    """1 % quantile of the limit over the doubt (m)."""
    high: float
    """99 % quantile (m)."""
    drawn: Drawn
    """Spindles that it was judged on."""
    chatters: NDArray[np.bool_]
    """Which of the draws chatter, without the middle, shape (DRAWS,)."""


def judge(
    table: ProgramTable, tool: Assembly | DataError, machine: Machine, at_speed: SpindleAtSpeed = AT_REST
) -> Verdict:
    """The verdict on a program as it stands in machine.toml, or why its tool is not known."""
    if isinstance(tool, DataError):
        return unknown(table, (Remark("no-tap", "", str(tool)),))
    if not tool.directions:
        return unknown(table, tool.remarks, tool)
    table = at_speed.taught(table)
    word, middle, low, high, drawn, chatters = weigh(table, tool, machine, at_speed)
    program, cause, remarks = as_program(table, machine), "", [*_remarks(table, tool, at_speed, machine)]
    if word is Word.DOUBTFUL:
        row = middle_row(program, at_speed.moved(tool))
        cause = "question" if tool.questions else decisive(drawn, chatters, row, program.depth)
        remarks.append(
            settles(cause, table, middle.limit / program.depth * program.cut.tangential, tool, at_speed.cuts)
        )
    return Verdict(
        program=table,
        word=word,
        assembly=tool,
        at_speed=at_speed,
        limit=middle.limit,
        limit_low=min(low, middle.limit),
        limit_high=max(high, middle.limit),
        chance_turning=float(np.mean(chatters)) if at_speed.cuts else _chance_turning(drawn, program.depth),
        decided_by=cause,
        chatter_frequency=middle.chatter_frequency,
        kind=middle.kind,
        feed_angle=middle.feed_angle,
        method=middle.method,
        detail=f"{middle.detail}, {DRAWS} draws from the doubt",
        drive_limit=float(drive_limit(machine, table, np.array([table.speed_rpm]))[0]),
        drawn=drawn,
        remarks=tuple(remarks),
    )


def weigh(table: ProgramTable, assembly: Assembly, machine: Machine, at_speed: SpindleAtSpeed = AT_REST) -> Judgement:
    """The word on a program by semi-discretisation over its doubt; charts by other methods decide nothing.

    table: with the coefficients that test cuts have taught.
    """
    program, spindle = as_program(table, machine), at_speed.moved(assembly)
    middle = program_limit(program, spindle.x, spindle.y, table.feed_angles)
    doubt = at_speed.doubt or doubt_of(assembly, table, machine)
    drawn = draw(program, middle, table.feed_angles, spindle, doubt)
    limits = drawn_limits(drawn, program.depth)[1:]
    low, high = np.quantile(limits, QUANTILES, method="closest_observation")
    near = drawn.fed(SURELY * program.depth * middle.limit / low if np.isfinite(middle.limit) else 0.0)
    chatters = (near.growth(program.depth)[1:, 0] >= 0) | (limits <= program.depth)
    return Judgement(_word(middle.stable, chatters, assembly), middle, float(low), float(high), drawn, chatters)


def _chance_turning(drawn: Drawn, depth: float) -> float:
    """Chance of chatter at a depth (m) with the spindle turning, where nothing was learnt of that."""
    return float(np.mean(turning(drawn.fed(0.0)).growth(depth)[1:] >= 0))


def _word(stable: bool, chatters: NDArray[np.bool_], assembly: Assembly) -> Word:
    if not stable:
        return Word.NOT_STABLE
    sure = not np.any(chatters) and assembly.is_sure
    return Word.STABLE if sure else Word.DOUBTFUL


def unknown(table: ProgramTable, why: tuple[Remark, ...], assembly: Assembly | None = None) -> Verdict:
    """The verdict on a program that cannot be checked."""
    reasons = "; ".join(map(str, why)) or "no modes at the tool tip"
    remark = Remark("not-checked", table.name, f"not checked: {reasons}")
    return Verdict(table, Word.UNKNOWN, assembly, remarks=(remark,))


def as_program(table: ProgramTable, machine: Machine) -> Program:
    """A program in SI units."""
    return Program(machine.build_cut(table), table.speed_rpm, table.depth_mm / 1e3)


def _remarks(table: ProgramTable, assembly: Assembly, at_speed: SpindleAtSpeed, machine: Machine) -> Iterator[Remark]:
    yield from (remark for remark in assembly.remarks if remark.code in (*ABOUT_DIRECTIONS, "predicted"))
    yield from at_speed.remarks
    yield from assembly.questions
    if min(machine.drive.power_kw, machine.drive.torque_nm) < np.inf and table.feed_per_tooth_mm is None:
        yield Remark("drive-ignored", table.name, "[drive] does not count: feed_per_tooth_mm is missing")
