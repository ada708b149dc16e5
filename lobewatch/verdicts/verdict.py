"""The verdict on a cutting program: the one place that says whether it is stable, how surely, and how far."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from acquisition import DataError, Remark
from lobewatch.machine import CutTable, Machine, ProgramTable, drive_limit
from lobewatch.machine.settings.known_tool import feed_that_counts
from lobewatch.machine.settings.setting_questions import questions_of_program
from lobewatch.tool.assembly import ABOUT_DIRECTIONS, Assembly
from lobewatch.verdicts.draws import DRAWS, ProgramDraws, turning_draws
from lobewatch.verdicts.judgement import Judgement, weigh
from lobewatch.verdicts.settling import decisive_cause, settling_remark
from lobewatch.verdicts.speed_pockets import pockets_remark
from lobewatch.verdicts.spindle_at_speed import AT_REST, SpindleAtSpeed
from lobewatch.verdicts.tool_remarks import outside_tool
from lobewatch.verdicts.unsaid import unsaid

NOT_CHECKED = "not-checked"
"""Code of the remark that says why a program could not be checked."""


class Word(StrEnum):
    """Word that is said of a program."""

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
    """Fall up to which it stays stable; NaN where it could not be checked."""
    not_stable: float
    """Fall up to which it stays stable in the middle of the doubt; NaN where it could not be checked."""
    error: float
    """Standard error of `not_stable`, by damping and stiffness as they scatter from tap test to tap test."""


class Ruling(NamedTuple):
    """What the history keeps of a verdict."""

    word: Word
    """Word on the program."""
    limit: float
    """Deepest stable depth at the program's speed in the middle of the doubt (m); NaN where it is not known."""
    critical: CriticalFall | None = None
    """Falls of the frequency that change the word; None where nobody has asked yet."""

    @property
    def stable(self) -> bool | None:
        """Whether it is stable in the middle of the doubt; None where it is unknown."""
        return None if self.word is Word.UNKNOWN else self.word is not Word.NOT_STABLE


@dataclass(frozen=True, eq=False)
class Verdict:
    """Whether a program is stable with a tool in the spindle as it is known at some time."""

    program: ProgramTable
    """Program as it stands in machine.toml, with the cutting coefficients that test cuts have taught."""
    word: Word
    """Word on the program."""
    assembly: Assembly | None = None
    """Tool as tapped that it was checked with; None where there is nothing to check with."""
    at_speed: SpindleAtSpeed = AT_REST
    """Spindle as test cuts have taught it beside that."""
    limit: float = math.nan
    """Deepest stable depth at its speed in the middle of the doubt, in the worst direction of feed (m); inf where there
    is none up to 20 times its own, NaN where unknown."""
    limit_low: float = math.nan
    """1 % quantile of the limit over the doubt (m)."""
    limit_high: float = math.nan
    """99 % quantile of the limit over the doubt (m)."""
    chance_turning: float = math.nan
    """Chance of chatter with the spindle turning, under plausible differences between rest and cut, or those learnt."""
    decided_by: str = ""
    """Cause of the doubt that decides (`Doubt.causes`), "question" where a tap test is in question, "workpiece" where
    it is thin; empty unless it is doubtful."""
    chatter_frequency: float = math.nan
    """Frequency that is heard at the limit (Hz); NaN where there is none."""
    kind: str = ""
    """Kind of the limit: "hopf", "flip" or ""."""
    feed_angle: float = math.nan
    """Direction of feed that is worst, as an angle from x (rad)."""
    method: str = ""
    """Method that the limit was found by."""
    detail: str = ""
    """Fineness of the method, and number of draws."""
    drive_limit: float = math.inf
    """Deepest cut that power and torque allow at its speed (m); inf where no limit is known."""
    draws: ProgramDraws | None = None
    """Spindles that it was judged on; None where it is unknown."""
    remarks: tuple[Remark, ...] = ()
    """Remarks on what it rests on, what would settle it, and why it is unknown."""

    @property
    def stable(self) -> bool | None:
        """Whether it is stable in the middle of the doubt; None where it is unknown."""
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


def judge(
    table: ProgramTable,
    tool: Assembly | DataError,
    machine: Machine,
    at_speed: SpindleAtSpeed = AT_REST,
    judgement: Judgement | None = None,
) -> Verdict:
    """The verdict on a program as it stands in machine.toml, or why its tool is not known.

    judgement: that of `weigh`, where it is known already.
    """
    if isinstance(tool, DataError):
        unknown = _unknown(table, (Remark("no-tap", "", str(tool)),))
        return replace(unknown, remarks=(*unknown.remarks, *outside_tool(table, machine)))
    if not tool.directions:
        return _unknown(table, tool.remarks, tool, pockets_remark(table, table.name, tool, machine))
    on_model = tool.predicted or machine.tap.position_mm > 0
    if asked := questions_of_program(machine, table, on_model):
        return _unknown(table, tuple(doubted.remark for doubted in asked), tool)
    table = at_speed.taught(table)
    judgement, depth = judgement or weigh(table, tool, machine, at_speed), table.depth_mm / 1e3
    middle, word, cause = judgement.middle, word_of(table, judgement, tool), ""
    remarks = [*_remarks(table, tool, at_speed, machine), *unsaid(table, machine, judgement)]
    if word is Word.DOUBTFUL:
        cause = _cause(table, judgement, tool)
        tangential = middle.limit / depth * machine.build_cut(table).tangential
        remarks.append(settling_remark(cause, table, tangential, tool, at_speed.cuts))
    return Verdict(
        program=table,
        word=word,
        assembly=tool,
        at_speed=at_speed,
        limit=middle.limit,
        limit_low=min(judgement.low, middle.limit),
        limit_high=max(judgement.high, middle.limit),
        chance_turning=_chance_turning(judgement, depth, at_speed),
        decided_by=cause,
        chatter_frequency=middle.chatter_frequency,
        kind=middle.kind,
        feed_angle=middle.feed_angle,
        method=middle.method,
        detail=f"{middle.detail}, {DRAWS} draws from the doubt",
        drive_limit=float(drive_limit(machine, table, np.array([table.speed_rpm]))[0]),
        draws=judgement.draws,
        remarks=tuple(remarks),
    )


def _unknown(
    table: ProgramTable,
    reasons: tuple[Remark, ...],
    assembly: Assembly | None = None,
    further: tuple[Remark, ...] = (),
) -> Verdict:
    """The verdict on a program that cannot be checked."""
    text = "; ".join(map(str, reasons)) or "no modes at the tool tip"
    remark = Remark(NOT_CHECKED, table.name, f"not checked: {text}")
    return Verdict(table, Word.UNKNOWN, assembly, remarks=(remark, *further))


def word_of(table: ProgramTable, judgement: Judgement, assembly: Assembly) -> Word:
    """The word on a program with a tool that was judged."""
    if not judgement.middle.stable:
        return Word.NOT_STABLE
    return Word.STABLE if judgement.is_stable_throughout and is_sure(table, assembly) else Word.DOUBTFUL


def is_sure(table: CutTable, assembly: Assembly) -> bool:
    """Whether all that gives way is known: both directions of the tool, without a question, and no thin wall."""
    return unanswered(table, assembly) is None


def unanswered(table: CutTable, assembly: Assembly) -> tuple[str, str] | None:
    """What is not known of what gives way, and what to do first; None where nothing is left open."""
    if len(assembly.directions) < 2:
        return assembly.gap
    if isinstance(table, ProgramTable) and table.thin:
        return "the wall that is cut is thin", "support the wall, which is thin"
    if assembly.questions:
        codes = dict.fromkeys(question.code for question in assembly.questions)
        cure = "tap again" if "newest-damaged" in codes else "answer what is asked of its tap tests"
        return f"it rests on a tap test in question ({', '.join(codes)})", cure
    return None


def _cause(table: ProgramTable, judgement: Judgement, assembly: Assembly) -> str:
    """Cause of the doubt that decides."""
    if assembly.questions:
        return "question"
    if table.thin and assembly.is_sure and not np.any(judgement.chatters):
        return "workpiece"
    return decisive_cause(judgement, table.depth_mm / 1e3)


def _chance_turning(judgement: Judgement, depth: float, at_speed: SpindleAtSpeed) -> float:
    """Chance of chatter at a depth (m) with the spindle turning: as learnt, or under plausible differences."""
    if at_speed.cuts:
        return float(np.mean(judgement.chatters))
    return float(np.mean(turning_draws(judgement.draws.fed(0.0)).growth(depth)[1:] >= 0))


def _remarks(table: ProgramTable, assembly: Assembly, at_speed: SpindleAtSpeed, machine: Machine) -> Iterator[Remark]:
    yield from (remark for remark in assembly.remarks if remark.code in (*ABOUT_DIRECTIONS, "predicted"))
    yield from at_speed.remarks
    yield from assembly.questions
    yield from outside_tool(table, machine)
    if min(machine.drive.power_kw, machine.drive.torque_nm) < np.inf and feed_that_counts(machine, table) is None:
        yield Remark("drive-ignored", table.name, "[drive] does not count: feed_per_tooth_mm is missing")
