"""Answers of `lobewatch listen`: verdicts of recorded cuts, and the next speeds of a tool that was never tapped."""

from collections.abc import Sequence
from datetime import UTC, datetime

from acquisition import Remark
from lobewatch.cuts.learning.next_speed import NextSpeeds
from lobewatch.logbook import Logbook
from lobewatch.logbook.cut_comparison import CutComparison
from lobewatch.logbook.heard_cuts import is_tool_untapped, suggest_by_sound
from lobewatch.logbook.production import plan_next_cut
from lobewatch.machine.journal.entries import CutEntry
from lobewatch.show.cuts.next_speeds import next_speeds_json, next_speeds_texts
from lobewatch.show.cuts.production_steps import next_step_json, next_step_lines
from lobewatch.show.cuts.recorded_cuts import recording_json, recording_texts
from lobewatch.show.history import saved_cut_remarks
from lobewatch.show.terminal.output import JsonObject, Texts


def file_answer(comparisons: Sequence[CutComparison], found: NextSpeeds) -> tuple[JsonObject, Texts]:
    """Return the answer on a recorded cut of an unknown machine as JSON and texts."""
    payload = recording_json(comparisons) | next_speeds_json(found)
    return payload, [*recording_texts(comparisons), *next_speeds_texts(found)]


def unstored_answer(logbook: Logbook, comparisons: Sequence[CutComparison]) -> tuple[JsonObject, Texts]:
    """Return the answer on cuts that are not stored as JSON and texts."""
    now = datetime.now(UTC)
    made = [comparison.to_recorded_cut(now) for comparison in comparisons]
    payload, texts = _suggest_untapped(logbook, comparisons, [*logbook.cuts, *made])
    return recording_json(comparisons) | payload, [*recording_texts(comparisons), *texts]


def stored_answer(
    logbook: Logbook, comparisons: Sequence[CutComparison], earlier: Sequence[CutEntry], stored: Sequence[CutEntry]
) -> tuple[JsonObject, Texts, list[Remark]]:
    """Return the answer on stored cuts as JSON and texts, and the remarks on them; earlier: cuts before these."""
    remarks = [saved_cut_remarks(logbook, cut, [*earlier, *stored[:i]]) for i, cut in enumerate(stored)]
    rows = [
        {"id": cut.id, "remarks": [remark.code for remark in own]} for cut, own in zip(stored, remarks, strict=True)
    ]
    payload, texts = _suggest_untapped(logbook, comparisons, [*earlier, *stored])
    saved = recording_texts(comparisons, [cut.id for cut in stored])
    plan = plan_next_cut(logbook, stored[-1].program, [*earlier, *stored])
    texts = [*texts, *next_step_lines(plan, logbook.folder.path)]
    payload = recording_json(comparisons, rows) | payload | next_step_json(plan)
    return payload, [*saved, *texts], [remark for own in remarks for remark in own]


def _suggest_untapped(
    logbook: Logbook, comparisons: Sequence[CutComparison], cuts: Sequence[CutEntry]
) -> tuple[JsonObject, Texts]:
    """Return the next speeds from all cuts if the tool was never tapped; empty if it was."""
    setting = comparisons[-1].setting
    if not is_tool_untapped(logbook, setting.tool):
        return {}, []
    found = suggest_by_sound(logbook, setting, cuts)
    return next_speeds_json(found), next_speeds_texts(found)
