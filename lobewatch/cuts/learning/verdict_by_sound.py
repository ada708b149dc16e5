"""Verdict on a program whose machine was never tapped, by its test cuts only."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from datetime import datetime

import numpy as np

from acquisition import Remark
from lobewatch.cuts.learning.cut_likelihood import REPEAT_SPEED_TOLERANCE
from lobewatch.cuts.learning.pocket_depth import PROGRAM_SPEED_TOLERANCE
from lobewatch.machine import Machine, ProgramTable, drive_depth_limit
from lobewatch.machine.journal.entries import CutEntry, geometry_key, list_decisive_cuts, material_key
from lobewatch.machine.settings.display_units import LENGTH
from lobewatch.machine.settings.setting_questions import find_program_questions
from lobewatch.verdicts.uncertainty_causes import NO_TAP_TEST
from lobewatch.verdicts.verdict import Stability, Verdict

FEED_TOLERANCE = 0.2
"""Relative difference of two feeds per tooth of one class; chosen."""
DEPTH_TOLERANCE = 1e-6
"""Relative difference of two equal depths."""


def evaluate_by_sound(
    verdict: Verdict, machine: Machine, cuts: Sequence[CutEntry], since: datetime | None = None
) -> Verdict:
    """Evaluate a program by the test cuts at its speed: stable, not stable, else doubtful.

    It is stable at or below a depth that was stable at its very speed, and not stable at or above one that chattered
    within 1 % of it. The newest such cut counts. A stable one after chatter leaves the program doubtful. Tool,
    engagement, material, feed axis and feed per tooth must be those of the program, and the cut not older than the
    newest baseline. A worn edge, a thin wall and a corner count only in a cut of the program itself.

    Parameters
    ----------
    verdict
        Verdict without a tap test.
    machine
        Machine.
    cuts
        Cuts of the journal, oldest first.
    since
        Time of the newest baseline; None without one.
    """
    program = verdict.program
    if asked := find_program_questions(machine, program, on_model=False):
        return replace(verdict, remarks=(*verdict.remarks, *(question.remark for question in asked)))
    found = find_deciding_cuts(program, machine, cuts, since)
    drive_limit = float(drive_depth_limit(machine, program, np.array([program.speed_rpm]))[0])
    others = tuple(remark for remark in verdict.remarks if remark.code not in ("not-checked", "no-tap"))
    remarks = tuple(_explain(found, program))
    stability = _classify(found)
    cause = NO_TAP_TEST.name if stability is Stability.DOUBTFUL else ""
    return replace(
        verdict, stability=stability, decisive_cause=cause, drive_limit=drive_limit, remarks=(*remarks, *others)
    )


def find_deciding_cuts(
    program: ProgramTable, machine: Machine, cuts: Sequence[CutEntry], since: datetime | None = None
) -> list[CutEntry]:
    """Find the test cuts that decide on a program (see `evaluate_by_sound`), oldest first.

    Parameters
    ----------
    program
        Program.
    machine
        Machine.
    cuts
        Cuts of the journal, oldest first.
    since
        Time of the newest baseline; None without one.
    """
    recent = [cut for cut in cuts if since is None or cut.at >= since]
    return [cut for cut in list_decisive_cuts(recent) if _decides(cut, program, machine)]


def _classify(found: Sequence[CutEntry]) -> Stability:
    """Return the stability by the decisive cuts, oldest first."""
    if found and found[-1].has_chatter:
        return Stability.NOT_STABLE
    return Stability.STABLE if found and not _find_chatter(found) else Stability.DOUBTFUL


def _find_chatter(found: Sequence[CutEntry]) -> CutEntry | None:
    """Return the newest cut that chattered, or None."""
    return next((cut for cut in reversed(found) if cut.has_chatter), None)


def _explain(found: Sequence[CutEntry], program: ProgramTable) -> Iterator[Remark]:
    """Explain the stability by the decisive cuts, oldest first."""
    if not found:
        cure = NO_TAP_TEST.remedy.format(tool=repr(program.tool), program=program.name)
        yield Remark("no-tap-test", program.name, NO_TAP_TEST.sentence, cure)
        return
    cut, chatter = found[-1], _find_chatter(found)
    text = f"verdict based only on cut {cut.id} ({_describe(cut)}), without a tap test"
    yield Remark("no-tap-test", program.name, text, "Tap the tool to know the depth margin")
    if chatter is not None and not cut.has_chatter:
        yield make_contradiction_remark(chatter.id, _describe(chatter))


def make_contradiction_remark(cut: str, summary: str, cure: str = "Exclude the wrong test cut") -> Remark:
    """Return a remark on a cut with another result at the same point.

    Parameters
    ----------
    cut
        Identity of the cut.
    summary
        Text that describes it.
    cure
        Remedy.
    """
    text = f"contradicts another test cut at the same speed and depth ({summary})"
    return Remark("cuts-contradict", cut, text, cure)


def _describe(cut: CutEntry) -> str:
    return f"{'chatter' if cut.has_chatter else 'stable'} at {LENGTH.text(1e3 * cut.depth, '.4g')}"


def _decides(cut: CutEntry, program: ProgramTable, machine: Machine) -> bool:
    """Return whether a cut decides on a program: the same cut, stable no shallower or chattering no deeper."""
    made, material = machine.build_cut(program), machine.coefficients(program).material
    same = cut.tool, geometry_key(cut.cut), material_key(cut.coefficients, cut.cut), cut.feed
    is_same = same == (program.tool, geometry_key(made), material_key(material, made), program.feed)
    if not (cut.is_usable and is_same and _is_same_feed(cut.feed_per_tooth, program)):
        return False
    depth, rpm = program.depth_mm / 1e3, program.speed_rpm
    if cut.has_chatter:
        is_near = abs(cut.speed_rpm / rpm - 1) <= PROGRAM_SPEED_TOLERANCE
        return is_near and cut.depth <= depth * (1 + DEPTH_TOLERANCE)
    if min(abs(speed / rpm - 1) for speed in (cut.speed_rpm, cut.commanded_rpm)) > REPEAT_SPEED_TOLERANCE:
        return False
    is_plain = not program.thin and program.corner_radius_mm is None and (program.wear or machine.doubt.wear) == "new"
    return cut.depth >= depth * (1 - DEPTH_TOLERANCE) and (is_plain or cut.program == program.name)


def _is_same_feed(feed_per_tooth: float | None, program: ProgramTable) -> bool:
    """Return whether a feed per tooth (m) is in the class of that of a program, or both are unknown."""
    if feed_per_tooth is None or program.feed_per_tooth_mm is None:
        return feed_per_tooth is None and program.feed_per_tooth_mm is None
    return abs(1e3 * feed_per_tooth / program.feed_per_tooth_mm - 1) <= FEED_TOLERANCE
