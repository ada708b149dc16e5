"""Show replays, replay previews and rebuilds, with their progress."""

import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import NamedTuple

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeRemainingColumn
from rich.table import Table

from acquisition import DataError, Fact, Remark
from acquisition.files.contents.contents import Origin
from dsm import format_rounded
from lobewatch.history import HistoryRow
from lobewatch.logbook import Logbook
from lobewatch.logbook.recordings.prepare_taps import HitCount
from lobewatch.logbook.recordings.store_recordings import MAX_NAMED_FILES, ReplayOutcome, group_by_message
from lobewatch.logbook.replay_preview import ReplayPreview
from lobewatch.measurement.hit_choice import format_decisions, format_unused_hits
from lobewatch.measurement.recording_questions import find_open_questions, question_remarks
from lobewatch.show.measurement import measurement_json, measurement_texts
from lobewatch.show.modes import NON_FILE_ORIGINS, fact_lines, hits_json, mode_json, sort_modes
from lobewatch.show.programs.verdicts import program_texts, verdict_json
from lobewatch.show.terminal.output import JsonObject, Texts, count_noun, emit, new_table, notes, remark_lines
from modal import Mode

REPLAY_STEP_NAMES = {"read": "reading", "store": "fitting and storing", "measure": "evaluating"}
"""Names of the steps of a replay."""
FIRST_LINE_DELAY, LINE_INTERVAL = 0.5, 2.0
"""Time before the first line of progress and from line to line (s); chosen."""


class ReplayProgress(Progress):
    """Progress of each step of a replay: bars on a terminal, else lines."""

    def __init__(self) -> None:
        columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
        super().__init__(*columns, console=notes, transient=True, disable=not notes.is_terminal)
        self._step_ids: dict[str, TaskID] = {}
        self._next_line = time.monotonic() + FIRST_LINE_DELAY

    def __call__(self, step: str, done: int, of: int) -> None:
        """Show the progress of a step: so many files are done, of so many. A single file needs no line."""
        if self.disable and of > 1 and time.monotonic() >= self._next_line:
            notes.print(f"{REPLAY_STEP_NAMES[step]}: {done} of {of} files done", markup=False)
            self._next_line = time.monotonic() + LINE_INTERVAL
        if step not in self._step_ids:
            self._step_ids[step] = self.add_task(REPLAY_STEP_NAMES[step], total=of)
        self.update(self._step_ids[step], completed=done, total=of)


def make_rebuild_progress(name: str) -> Callable[[int, int], None]:
    """Return a function that prints a progress line every ten tap tests of this machine."""

    def show(done: int, of: int) -> None:
        if done % 10 == 0:
            notes.print(f"{name}: {done} of {of} tap tests", markup=False)

    return show


MAX_PREVIEWS_IN_FULL = 6
"""Largest number of files that are shown in full."""


def emit_preview(previews: Sequence[ReplayPreview], passed: Sequence[Path], *, as_json: bool) -> None:
    """Print a preview of a replay; passed: other files of the folders. Raise DataError for unusable files."""
    payload = {"dry_run": True, "files": [*map(preview_json, previews)], "passed_over": [*map(str, passed)]}
    emit(payload, as_json, *preview_texts(previews), preview_summary(previews, len(passed)))
    if refused := sum(bool(preview.rejection) for preview in previews):
        raise DataError(
            f"{refused} of {count_noun(len(previews), 'file')} cannot be used. Correct or omit the files listed above."
        )


def preview_json(preview: ReplayPreview) -> JsonObject:
    """Return the preview of one file."""
    recording, tap, measurement = preview.recording, preview.tap, preview.measurement
    status = {"file": str(preview.file), "known": preview.stored_tap_id, "refused": preview.rejection}
    if measurement is None or tap is None or recording is None:
        return status
    followed, asked = measurement.followed, find_open_questions(measurement.remarks)
    return {
        **status,
        "format": recording.title,
        "facts": recording.facts,
        "time": measurement.time.isoformat(),
        "tool": measurement.tool,
        "direction": measurement.direction,
        "hits": [flags.words for flags in tap.flags],
        "hit_list": hits_json(tap.flags, tap.decided_flags),
        "remarks": recording.remarks,
        "lines": tap.frf and tap.frf.frequency.size,
        "averages": tap.frf and tap.frf.n_averages,
        "modes": list(map(mode_json, measurement.modes)),
        "followed": followed and mode_json(followed),
        "questions": [{"code": question.code, "text": question.text} for question in asked],
    }


def preview_texts(previews: Sequence[ReplayPreview]) -> Texts:
    """Return a few files in full, many in a table with questions and rejections below it."""
    rejected = ((str(item.file), f"cannot be used: {item.rejection}") for item in previews if item.rejection)
    refused = group_by_message(rejected)
    if len(previews) <= MAX_PREVIEWS_IN_FULL:
        usable = (preview for preview in previews if not preview.rejection)
        return [*chain.from_iterable(map(_preview_lines, usable)), *refused]
    table = new_table("<date", "<series", "hits", "frequency (Hz)", "<", "~file", rows=map(_preview_row, previews))
    return [table, *_preview_notes(previews), *refused]


def preview_summary(previews: Sequence[ReplayPreview], n_passed: int) -> str:
    """Return how many files would be stored, are known, rejected and ignored."""
    fresh = sum(preview.tap is not None for preview in previews)
    n_known = sum(bool(preview.stored_tap_id) for preview in previews)
    refused = sum(bool(preview.rejection) for preview in previews)
    passed = f", {n_passed} other files ignored" if n_passed else ""
    files = count_noun(len(previews), "file")
    count = f"{fresh} of {files} would be stored, {n_known} stored already, {refused} cannot be used"
    return f"{count}{passed}. No file was stored (--dry-run)."


def _preview_lines(preview: ReplayPreview) -> list[str]:
    if preview.stored_tap_id:
        return [f"{preview.file}: stored already as {preview.stored_tap_id}"]
    measurement, recording = preview.measurement, preview.recording
    if measurement is None or preview.tap is None or recording is None:
        return []
    modes = sort_modes(measurement.modes, rejected=False)[:8]
    questions = [f"question ({remark.code}): {remark.text}" for remark in find_open_questions(measurement.remarks)]
    followed = f"{measurement.followed.frequency:.2f} Hz" if measurement.followed else "none"
    details = [*fact_lines(recording.facts), f"modes: {', '.join(map(_mode_text, modes)) or 'none'}"]
    details += [
        *map(str, recording.remarks),
        f"followed mode: {followed}",
        *(questions or ["plausible for this machine, no questions"]),
    ]
    words = Counter(flags.words for flags in preview.tap.flags)
    hits = f"{count_noun(len(preview.tap.hits), 'hit')}: " + ", ".join(
        f"{count} {word}" for word, count in words.items()
    )
    kind = hits if preview.tap.hits else "an FRF"
    details += filter(None, [format_unused_hits(preview.tap.decided_flags, recording.places)])
    return [f"{preview.file}: {recording.title}, {kind}", *(f"  {line}" for line in details)]


def _mode_text(mode: Mode) -> str:
    f_std, zeta_std, k_std = mode.standard_error.tolist()
    frequency, damping = format_rounded(mode.frequency, f_std), format_rounded(mode.damping_ratio, zeta_std, 0.01)
    stiffness = f", {format_rounded(mode.stiffness, k_std, 1e6)} N/um" if mode.has_stiffness else ""
    return f"{frequency} Hz ({damping} %{stiffness})"


def _preview_row(preview: ReplayPreview) -> list[str]:
    measurement, tap = preview.measurement, preview.tap
    if measurement is None or tap is None:
        return ["", "", "", "", "stored already" if preview.stored_tap_id else "rejected", preview.file.name]
    asked = find_open_questions(measurement.remarks)
    good = f"{len(tap.accepted)}/{len(tap.hits)}" if tap.hits else "FRF"
    frequency = "" if measurement.followed is None else f"{measurement.followed.frequency:.2f}"
    series, day = f"{measurement.tool} {measurement.direction}", f"{measurement.time:%Y-%m-%d}"
    return [day, series, good, frequency, "question" if asked else "plausible", preview.file.name]


def _preview_notes(previews: Sequence[ReplayPreview]) -> list[str]:
    """Return assumed facts and questions, each once."""
    facts = dict.fromkeys(fact for preview in previews if preview.recording for fact in preview.recording.facts)
    asked = (
        (preview.file.name, f"question ({question.code}): {question.text}")
        for preview in previews
        if preview.measurement is not None
        for question in find_open_questions(preview.measurement.remarks)
    )
    return [*fact_lines(_merge_facts(facts), NON_FILE_ORIGINS), *group_by_message(asked)]


def _merge_facts(facts: Iterable[Fact]) -> Iterator[Fact]:
    """Return facts, with values that differ in many files as the first and the last."""
    values: dict[tuple[str, Origin], list[str]] = {}
    for fact in facts:
        values.setdefault((fact.name, fact.origin), []).append(fact.value)
    for (name, origin), texts in values.items():
        shown = texts if len(texts) <= MAX_NAMED_FILES else [f"{texts[0]} to {texts[-1]}"]
        yield from (Fact(name, text, origin) for text in shown)


MAX_TAPS_IN_FULL = 3
"""Largest number of tap tests that are shown in full."""
MIN_FILES_TO_COUNT = 12
"""Largest number of files of which all known ones are listed."""
MAX_KNOWN_LISTED = 3
"""Largest number of known files that are always listed."""


def emit_replay(
    outcome: ReplayOutcome, logbook: Logbook, n_files: int, passed: Sequence[Path], codes: Sequence[str], as_json: bool
) -> None:
    """Print the outcome of a replay; passed: other files of the folders; codes: of questions answered."""
    known = [f"{file.name}: stored already as {tap_id}" for file, tap_id in outcome.already_stored.items()]
    decided = {tap_id: logbook.files.by_id[tap_id].hit_decisions for tap_id in outcome.tap_ids}
    if n_files > MIN_FILES_TO_COUNT and len(known) > MAX_KNOWN_LISTED:
        known = [f"{len(known)} of {n_files} files are stored already"]
    known += [f"{file.name}: {text}" for file, text in outcome.unused_hits.items()]
    known += [f"hits by hand: {format_decisions(decisions)}" for decisions in decided.values() if decisions]
    known += [f"ignored: {len(passed)} other files, such as {passed[0].name}"] if passed else []
    for line in known:
        notes.print(line, markup=False)
    if as_json:
        emit(replay_json(outcome, logbook) | {"accepted": codes, "questions": logbook.questions}, as_json)
        return
    texts = [*replay_texts(outcome, logbook), *(f"accepted: {code}" for code in codes)]
    emit(
        {},
        as_json,
        *texts,
        f"{_stored_summary(outcome, n_files)} in {logbook.folder.path}",
    )


def _stored_summary(outcome: ReplayOutcome, n_files: int) -> str:
    """Return how many files were stored, or that they are one tap test."""
    n_stored, n_taps = len(outcome.new_tap_ids), len(outcome.tap_ids) + len(outcome.rejected)
    decided = ", decisions on hits stored" if outcome.decided_tap_ids else ""
    if n_taps < n_files:
        return f"{n_files} files {'' if n_stored else 'already '}stored as one tap test{decided}"
    return f"{n_stored} of {count_noun(n_files, 'file')} stored{decided}"


def replay_json(outcome: ReplayOutcome, logbook: Logbook) -> JsonObject:
    """Return all new tap tests, those with new decisions on hits, and the files that were known already or rejected."""
    stored = [*outcome.new_tap_ids, *outcome.decided_tap_ids]
    return {
        "measurements": [measurement_json(logbook.measurement(tap_id), logbook) for tap_id in stored],
        "programs": list(map(verdict_json, logbook.verdicts())) if stored else [],
        "known": {str(file): tap_id for file, tap_id in outcome.already_stored.items()},
        "refused": {str(file): reason for file, reason in outcome.rejected.items()},
        "taken": outcome.assumed_facts,
        "unused_hits": {str(file): text for file, text in outcome.unused_hits.items()},
        "hits": {tap_id: count._asdict() for tap_id, count in outcome.hit_counts.items()},
        "remarks": outcome.remarks,
    }


def replay_texts(outcome: ReplayOutcome, logbook: Logbook) -> Texts:
    """Return a few tap tests in full, many as their series, and the verdicts on the programs."""
    stored, texts = [*outcome.new_tap_ids, *outcome.decided_tap_ids], Texts()
    if len(set(stored)) <= MAX_TAPS_IN_FULL:
        for tap_id in stored:
            texts += measurement_texts(logbook.measurement(tap_id), logbook)
            texts += _hit_count_texts([count for known, count in outcome.hit_counts.items() if known == tap_id])
    else:
        rows = logbook.history.rows
        asked = {row.tap_id: row.questions for row in rows}
        texts.append(_series_table([row for row in rows if row.tap_id in set(stored)]))
        questions = question_remarks(asked, logbook.folder.path, [tap_id for tap_id in stored if tap_id in asked])
        texts += [f"question on {question.finding}" for question in questions]
        texts += _hit_count_texts([*outcome.hit_counts.values()])
    texts += remark_lines(outcome.remarks)
    if outcome.assumed_facts:
        texts.append(f"assumed, not in the files: {', '.join(outcome.assumed_facts)}")
    return [*texts, *(program_texts(logbook) if stored else [])]


def _hit_count_texts(counts: Sequence[HitCount]) -> list[str]:
    """Return how many hits were found and used; nothing for FRFs."""
    found, used = sum(count.found for count in counts), sum(count.used for count in counts)
    return [f"hits: {found} found, {used} used"] if found else []


def _series_table(rows: Sequence[HistoryRow]) -> Table:
    """Return a table with a line for each tool and direction."""
    series: dict[tuple[str, str], list[HistoryRow]] = {}
    for row in rows:
        series.setdefault((row.tool, row.direction), []).append(row)
    headings = "<tool", "<direction", "tests", "<from", "<to", "~frequency (Hz)", "~damping (%)", "~stiffness (N/um)"
    table = new_table(*headings)
    for (tool, direction), tests in series.items():
        modes = [row.mode for row in tests if row.mode is not None]
        ends = (modes[0], modes[-1]) if modes else ()
        frequency = " .. ".join(f"{mode.frequency:.1f}" for mode in ends)
        damping = " .. ".join(f"{100 * mode.damping_ratio:.2f}" for mode in ends)
        stiffness = " .. ".join(f"{mode.stiffness / 1e6:.1f}" for mode in ends if mode.has_stiffness)
        days = (f"{test.time:%Y-%m-%d}" for test in (tests[0], tests[-1]))
        table.add_row(tool, direction, str(len(tests)), *days, frequency, damping, stiffness)
    return table


class MachineRebuild(NamedTuple):
    """Outcome of rebuilding one machine."""

    repairs: Sequence[str]
    """Sentences on repaired files."""
    n_taps: int
    """Number of tap tests in the new history."""
    is_saved: bool
    """True if the new history is on disk."""
    remarks: Sequence[Remark]
    """Remarks on the machine after the rebuild."""


def rebuild_json(rebuild: MachineRebuild) -> JsonObject:
    """Return the outcome of rebuilding one machine."""
    return {"done": rebuild.repairs, "tap_tests": rebuild.n_taps, "remarks": rebuild.remarks}


def rebuild_texts(rebuild: MachineRebuild) -> list[str]:
    """Return the outcome of rebuilding one machine in words."""
    made = f"rebuilt from {count_noun(rebuild.n_taps, 'tap test')}"
    missing = "not rebuilt for the reason above. The next command with write access rebuilds the history."
    return [*rebuild.repairs, *remark_lines(rebuild.remarks), f"history.rows: {made if rebuild.is_saved else missing}"]


def folder_rebuild_json(rebuilds: Mapping[str, MachineRebuild]) -> JsonObject:
    """Return the outcomes of rebuilding the machines of a folder, by name."""
    return {"machines": {name: rebuild_json(rebuild) for name, rebuild in rebuilds.items()}}


def folder_rebuild_texts(rebuilds: Mapping[str, MachineRebuild], n_machines: int) -> list[str]:
    """Return the outcomes of rebuilding a folder in words; n_machines: failed ones included."""
    lines = [f"{name}: {text}" for name, rebuild in rebuilds.items() for text in rebuild_texts(rebuild)]
    return [*lines, f"{len(rebuilds)} of {n_machines} machines rebuilt"]
