"""The verdict on a cutting program: the one place that says whether it is stable, and how far."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from acquisition import Remark
from lobes import Program, program_limit
from lobewatch.analysis.assembly import ABOUT_DIRECTIONS, Assembly
from lobewatch.machine import Machine, ProgramTable, drive_limit


class Word(StrEnum):
    """What is said of a program."""

    STABLE = "stable"
    NOT_STABLE = "not stable"
    UNKNOWN = "unknown"
    """It could not be checked; a remark says why."""


class Ruling(NamedTuple):
    """What the history keeps of a verdict."""

    word: Word
    """See Word."""
    limit: float
    """Deepest stable depth at the program's speed (m); NaN where it is not known."""

    @property
    def stable(self) -> bool | None:
        """None where it is unknown."""
        return None if self.word is Word.UNKNOWN else self.word is Word.STABLE


@dataclass(frozen=True, eq=False)
class Verdict:
    """Whether a program is stable with a tool in the spindle as it is known at some time."""

    program: ProgramTable
    """As it stands in machine.toml."""
    word: Word
    """See Word."""
    assembly: Assembly | None = None
    """What it was checked with; None where there is nothing to check with."""
    limit: float = math.nan
    """Deepest stable depth at its speed (m); inf where there is none up to 20 times its own, NaN where unknown."""
    chatter_frequency: float = math.nan
    """Frequency that is heard at the limit (Hz); NaN where there is none."""
    kind: str = ""
    """"hopf", "flip" or ""."""
    method: str = ""
    """How the limit was found."""
    detail: str = ""
    """Into how many intervals the tooth period was divided."""
    drive_limit: float = math.inf
    """Deepest cut that power and torque allow at its speed (m); inf where no limit is known."""
    remarks: tuple[Remark, ...] = ()
    """What it rests on, and why it is unknown."""

    @property
    def stable(self) -> bool | None:
        """None where it is unknown."""
        return self.ruling.stable

    @property
    def measured(self) -> bool:
        """Whether its tool was tapped; else all is predicted by the model, or unknown."""
        return self.assembly is not None and not self.assembly.predicted

    @property
    def depth_margin(self) -> float:
        """Limit over depth, less 1; negative where it is not stable."""
        return self.limit / (self.program.depth_mm / 1e3) - 1

    @property
    def is_beyond_drive(self) -> bool:
        """Whether it asks for more power or torque than there is."""
        return self.program.depth_mm / 1e3 > self.drive_limit

    @property
    def ruling(self) -> Ruling:
        """What the history keeps."""
        return Ruling(self.word, self.limit)


def verdict(table: ProgramTable, assembly: Assembly, machine: Machine) -> Verdict:
    """Judge a program by semi-discretisation; charts by other methods decide nothing."""
    if not assembly.directions:
        return unknown(table, assembly.remarks, assembly)
    found = program_limit(as_program(table, machine), assembly.x, assembly.y)
    return Verdict(
        program=table,
        word=Word.STABLE if found.stable else Word.NOT_STABLE,
        assembly=assembly,
        limit=found.limit,
        chatter_frequency=found.chatter_frequency,
        kind=found.kind,
        method=found.method,
        detail=found.detail,
        drive_limit=float(drive_limit(machine, table, np.array([table.speed_rpm]))[0]),
        remarks=tuple(_remarks(table, assembly, machine)),
    )


def unknown(table: ProgramTable, why: tuple[Remark, ...], assembly: Assembly | None = None) -> Verdict:
    """The verdict on a program that cannot be checked."""
    reasons = "; ".join(map(str, why)) or "no modes at the tool tip"
    remark = Remark("not-checked", table.name, f"not checked: {reasons}")
    return Verdict(table, Word.UNKNOWN, assembly, remarks=(remark,))


def as_program(table: ProgramTable, machine: Machine) -> Program:
    """A program in SI units."""
    return Program(machine.build_cut(table), table.speed_rpm, table.depth_mm / 1e3)


def _remarks(table: ProgramTable, assembly: Assembly, machine: Machine) -> Iterator[Remark]:
    about_modes = (*ABOUT_DIRECTIONS, "predicted")
    yield from (remark for remark in assembly.remarks if remark.code in about_modes)
    if min(machine.drive.power_kw, machine.drive.torque_nm) < np.inf and table.feed_per_tooth_mm is None:
        yield Remark("drive-ignored", table.name, "[drive] does not count: feed_per_tooth_mm is missing")
