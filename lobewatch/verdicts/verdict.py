"""Verdict on a cutting program: stability, limits, chatter risk and frequency margins."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from acquisition import DataError, Remark
from acquisition.errors import join_sentences
from lobewatch.machine import CutTable, Machine, ProgramTable, drive_depth_limit
from lobewatch.machine.settings.setting_questions import find_program_questions
from lobewatch.machine.settings.tool_limits import find_feed_per_tooth
from lobewatch.measurement.coverage import describe_uncovered
from lobewatch.tool.assembly import DIRECTION_CODES, Assembly
from lobewatch.verdicts import program_remarks
from lobewatch.verdicts.monte_carlo import MonteCarloResult, estimate_chatter_risk, run_monte_carlo
from lobewatch.verdicts.program_case import NO_TEST_CUTS, ProgramCase, SpindleAtSpeed
from lobewatch.verdicts.program_samples import N_PROGRAM_SAMPLES, ProgramSamples
from lobewatch.verdicts.speed_pockets import speed_pocket_remarks
from lobewatch.verdicts.uncertainty_causes import COVERAGE, NO_TAP_TEST, QUESTION, UNCHECKED, UNTAPPED, WORKPIECE

NOT_CHECKED_CODE = "not-checked"
"""Code of the remark that says why a program could not be checked."""


class Stability(StrEnum):
    """Stability of a program: the four words of a verdict."""

    STABLE = "stable"
    """At most 1 % of the samples chatter, at 95 % confidence, not rotating and over the frequency drop at speed."""
    DOUBTFUL = "doubtful"
    """Stable in the median estimate, but more samples may chatter; a remark names the decisive cause and its remedy."""
    NOT_STABLE = "not stable"
    """Chatter in the median estimate, whatever the principal directions may be."""
    UNKNOWN = "unknown"
    """Not evaluated; a remark says why."""


class CriticalDrop(NamedTuple):
    """Relative frequency drops from now that change a verdict; 0 if it has changed already, inf if none changes it."""

    doubtful: float
    """Drop up to which the program stays stable; NaN if it was not evaluated."""
    not_stable: float
    """Drop up to which it stays stable in the median estimate; NaN if it was not evaluated."""
    error: float
    """Standard error of `not_stable`, from the scatter of damping and stiffness between tap tests."""


class StoredVerdict(NamedTuple):
    """The part of a verdict that the history stores."""

    stability: Stability
    """Stability of the program."""
    limit: float
    """Median estimate of the deepest stable depth at the speed of the program (m); NaN if unknown."""
    critical: CriticalDrop | None = None
    """Frequency drops that change the verdict; None if not computed yet."""

    @property
    def is_stable(self) -> bool | None:
        """True if the program is stable in the median estimate; None if unknown."""
        return None if self.stability is Stability.UNKNOWN else self.stability is not Stability.NOT_STABLE


@dataclass(frozen=True, eq=False)
class Verdict:
    """Verdict on a program with a tool in the spindle, as of some tap test."""

    program: ProgramTable
    """Program as in machine.toml, with the cutting coefficients learned from test cuts."""
    stability: Stability
    """Stability of the program."""
    assembly: Assembly | None = None
    """Tool that it was evaluated with; None if there is none."""
    at_speed: SpindleAtSpeed = NO_TEST_CUTS
    """Spindle at speed, as learned from test cuts."""
    limit: float = math.nan
    """Median estimate of the deepest stable depth at its speed, in the worst feed direction (m); inf if there is no
    limit up to 20 times its own depth, NaN if unknown. Of unknown principal directions the worst in which it is stable
    counts, if there is one."""
    limit_low: float = math.nan
    """1 % quantile of the limit (m)."""
    limit_high: float = math.nan
    """99 % quantile of the limit (m)."""
    limit_at_speed: float = math.nan
    """Lowest limit of the median over the frequency drop at speed (m); the limit where test cuts have been learned."""
    chatter_risk: float = math.nan
    """Chatter risk with the spindle rotating (0 to 1): estimated from plausible differences, or learned."""
    decisive_cause: str = ""
    """Name of the decisive cause of uncertainty (see `UNCERTAINTY_CAUSES`); empty unless the verdict is doubtful."""
    chatter_frequency: float = math.nan
    """Chatter frequency at the limit (Hz); NaN without a limit."""
    kind: str = ""
    """Kind of the limit: "hopf", "flip" or ""."""
    feed_angle: float = math.nan
    """Worst feed direction, as an angle from x (rad)."""
    method: str = ""
    """Method of the limit."""
    detail: str = ""
    """Resolution of the method, and number of samples."""
    drive_limit: float = math.inf
    """Deepest cut that power and torque allow at its speed (m); inf without a limit."""
    samples: ProgramSamples | None = None
    """Monte Carlo samples; None if unknown."""
    remarks: tuple[Remark, ...] = ()
    """Remarks on assumptions, decisive uncertainty and remedies."""

    @property
    def is_stable(self) -> bool | None:
        """True if the program is stable in the median estimate; None if unknown."""
        return None if self.decisive_cause == NO_TAP_TEST.name else self.stored.is_stable

    @property
    def is_measured(self) -> bool:
        """True if the tool was tapped; else the verdict is predicted by the model, or unknown."""
        return self.assembly is not None and not self.assembly.predicted

    @property
    def n_cuts(self) -> int:
        """Number of test cuts learned from; 0 if the verdict holds for the spindle not rotating."""
        return self.at_speed.n_cuts

    @property
    def depth_margin(self) -> float:
        """Depth margin: median limit over depth, less 1; negative if not stable."""
        return self.limit / (self.program.depth_mm / 1e3) - 1

    @property
    def is_beyond_drive(self) -> bool:
        """True if it needs more power or torque than the drive has."""
        return self.program.depth_mm / 1e3 > self.drive_limit

    @property
    def stored(self) -> StoredVerdict:
        """Part that the history stores."""
        return StoredVerdict(self.stability, self.limit)


def evaluate_program(
    table: ProgramTable,
    tool: Assembly | DataError,
    machine: Machine,
    at_speed: SpindleAtSpeed = NO_TEST_CUTS,
    result: MonteCarloResult | None = None,
) -> Verdict:
    """Evaluate a program, or say why it cannot be evaluated.

    Parameters
    ----------
    table
        Program as in machine.toml.
    tool
        Tool as tapped or predicted, or the reason why it is unknown.
    machine
        Machine.
    at_speed
        Spindle at speed, as learned from test cuts.
    result
        Monte Carlo result of the same program, if it has been computed already.

    Returns
    -------
    Verdict
        Verdict with limits, uncertainty and remarks.

    References
    ----------
    .. [1] JCGM 101:2008, Propagation of distributions using a Monte Carlo method (GUM-S1).
    """
    if isinstance(tool, DataError):
        unknown = _unknown_verdict(table, (Remark("no-tap", "", str(tool)),))
        return replace(unknown, remarks=(*unknown.remarks, *program_remarks.tool_limit_remarks(table, machine)))
    if not tool.directions:
        return _unknown_verdict(table, tool.remarks, tool, speed_pocket_remarks(table, table.name, tool, machine))
    if asked := find_program_questions(machine, table, tool.predicted or machine.tap.position_mm > 0):
        return _unknown_verdict(table, tuple(doubted.remark for doubted in asked), tool)
    case = ProgramCase(at_speed.apply_coefficients(table), tool, machine, at_speed)
    return _build_verdict(case, result or run_monte_carlo(case))


def _build_verdict(case: ProgramCase, result: MonteCarloResult) -> Verdict:
    """Build the verdict on a program from its Monte Carlo result."""
    median, stability, cause = result.median, classify_stability(case, result), ""
    remarks = [*_verdict_remarks(case), *program_remarks.assumption_remarks(case, result)]
    if stability is Stability.STABLE:
        remarks += _stable_remarks(case.assembly)
    if stability is Stability.DOUBTFUL:
        cause = program_remarks.find_decisive_cause(case, result)
        remarks.append(program_remarks.uncertainty_advice(cause, case, result))
    drive_limit = drive_depth_limit(case.machine, case.table, np.array([case.table.speed_rpm]))
    return Verdict(
        program=case.table,
        stability=stability,
        assembly=case.assembly,
        at_speed=case.at_speed,
        limit=median.limit,
        limit_low=min(result.low, median.limit),
        limit_high=max(result.high, median.limit),
        limit_at_speed=result.limit_at_speed,
        chatter_risk=estimate_chatter_risk(result, case.depth, case.at_speed.n_cuts),
        decisive_cause=cause,
        chatter_frequency=median.chatter_frequency,
        kind=median.kind,
        feed_angle=median.cut.feed_angle,
        method=median.method,
        detail=f"{median.detail}, {N_PROGRAM_SAMPLES} Monte Carlo samples",
        drive_limit=float(drive_limit[0]),
        samples=result.samples,
        remarks=tuple(remarks),
    )


def _stable_remarks(assembly: Assembly) -> tuple[Remark, ...]:
    """Return the remarks on tap tests that are old or do not record their sensors."""
    unrecorded = (check.remark for check in assembly.chain_checks if not check.is_recorded)
    return (*dict.fromkeys(filter(None, unrecorded)), *assembly.age_remarks)


def apply_checks(verdict: Verdict, checked: Assembly) -> Verdict:
    """Return a verdict as of now: at most doubtful if its tap tests are too old, or nothing checks their sensors.

    checked: its tool with its age and the checks of its sensors.
    """
    known = _stable_remarks(checked) if verdict.stability is Stability.STABLE else ()
    unchecked = checked.unchecked if verdict.samples is not None else ()
    verdict = replace(verdict, assembly=checked, remarks=(*verdict.remarks, *known, *unchecked))
    missing_first = UNTAPPED.name, WORKPIECE.name, QUESTION.name, COVERAGE.name
    if not unchecked or not verdict.is_stable or verdict.decisive_cause in missing_first:
        return verdict
    others = (remark for remark in verdict.remarks if remark.code != "doubt-decides")
    advice = program_remarks.decisive_remark(verdict.program.name, *describe_uncovered(unchecked))
    return replace(verdict, stability=Stability.DOUBTFUL, decisive_cause=UNCHECKED.name, remarks=(*others, advice))


def _unknown_verdict(
    table: ProgramTable, reasons: tuple[Remark, ...], assembly: Assembly | None = None, further: tuple[Remark, ...] = ()
) -> Verdict:
    """Build the verdict on a program that cannot be evaluated."""
    text = join_sentences(*map(str, reasons)) or "no modes at the tool tip"
    remark = Remark(NOT_CHECKED_CODE, table.name, f"not checked: {text}")
    return Verdict(table, Stability.UNKNOWN, assembly, remarks=(remark, *further))


def classify_stability(case: ProgramCase, result: MonteCarloResult) -> Stability:
    """Classify the stability of a program from its Monte Carlo result."""
    if not result.median.stable:
        return Stability.NOT_STABLE
    is_stable = result.is_stable_throughout and is_compliance_known(case.table, case.assembly)
    return Stability.STABLE if is_stable else Stability.DOUBTFUL


def is_compliance_known(table: CutTable, assembly: Assembly) -> bool:
    """Return whether the compliance is known: both directions tapped and checked, no open question, no thin wall."""
    return find_open_question(table, assembly) is None


def find_open_question(table: CutTable, assembly: Assembly) -> tuple[str, str] | None:
    """Return what is unknown of the compliance and what to do first, or None."""
    if len(assembly.directions) < 2:
        return assembly.missing_direction
    if isinstance(table, ProgramTable) and table.thin:
        return "the wall is thin", "Support the thin wall"
    if assembly.questions:
        codes = dict.fromkeys(question.code for question in assembly.questions)
        cure = "Tap again" if "newest-damaged" in codes else "Answer the open questions about the tap tests"
        return f"a tap test has an open question ({', '.join(codes)})", cure
    remarks = assembly.uncovered or assembly.unchecked
    return describe_uncovered(remarks) if remarks else None


def _verdict_remarks(case: ProgramCase) -> Iterator[Remark]:
    machine, table = case.machine, case.table
    yield from (remark for remark in case.assembly.remarks if remark.code in (*DIRECTION_CODES, "predicted"))
    yield from case.at_speed.remarks
    assembly = case.assembly
    yield from (*assembly.questions, *assembly.uncovered, *assembly.unchecked, *assembly.hit_remarks)
    yield from program_remarks.tool_limit_remarks(table, machine)
    if min(machine.drive.power_kw, machine.drive.torque_nm) < np.inf and find_feed_per_tooth(machine, table) is None:
        yield Remark(
            "drive-ignored",
            table.name,
            "[drive] is ignored, because feed_per_tooth_mm is missing",
            "Set feed_per_tooth_mm",
        )
