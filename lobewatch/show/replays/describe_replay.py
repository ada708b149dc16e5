"""What recorded files have become, as JSON and as text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.table import Table

from lobewatch.history import Row
from lobewatch.logbook import Logbook
from lobewatch.logbook.replaying.store import ReplayOutcome
from lobewatch.measuring.questions import about_questions
from lobewatch.show.history.describe_measurement import measurement_json, measurement_texts
from lobewatch.show.programs.describe_verdicts import program_texts, programs_json
from lobewatch.show.terminal.output import emit, notes, table

IN_FULL = 3
"""Tap tests that are told in full at most; more of them are summed up."""
MANY = 12
"""Files of a replay above which those that were stored already are told by their number ..."""
FEW = 3
"""... unless these at most were."""


def show_replay(
    outcome: ReplayOutcome,
    logbook: Logbook,
    n_files: int,
    passed: Sequence[Path],
    accepted: Sequence[str],
    *,
    as_json: bool,
) -> None:
    """Print what has become of files; passed: other files of the folders; accepted: codes of questions answered."""
    _note_known(outcome.known, n_files)
    if passed:
        notes.print(f"passed over: {len(passed)} other files, such as {passed[0].name}", markup=False)
    payload, texts = dict[str, Any](), list[str | Table]()
    if as_json:
        payload = replay_json(outcome, logbook) | {"accepted": list(accepted), "questions": logbook.questions}
    else:
        texts = [*replay_texts(outcome, logbook), *(f"accepted: {code}" for code in accepted)]
    emit(payload, as_json, *texts, f"{len(outcome.fresh)} of {n_files} file(s) stored in {logbook.folder.path}")


def _note_known(stored: Mapping[Path, str], n_files: int) -> None:
    """Files that were stored already: each where they are few."""
    if n_files > MANY and len(stored) > FEW:
        notes.print(f"{len(stored)} of {n_files} files are stored already", markup=False)
        return
    for file, tap_id in stored.items():
        notes.print(f"{file.name}: stored already as {tap_id}", markup=False)


def replay_json(stored: ReplayOutcome, logbook: Logbook) -> dict[str, Any]:
    """All that was stored, with the lobes of each, known and refused."""
    return {
        "measurements": [measurement_json(logbook.measurement(tap_id), logbook) for tap_id in stored.fresh],
        "programs": programs_json(logbook.verdicts()) if stored.fresh else [],
        "known": {str(file): tap_id for file, tap_id in stored.known.items()},
        "refused": {str(file): why for file, why in stored.refused.items()},
        "taken": list(stored.taken),
    }


def replay_texts(stored: ReplayOutcome, logbook: Logbook) -> list[str | Table]:
    """A few tap tests in full, many as their series; then the programs."""
    fresh = set(stored.fresh)
    if len(fresh) <= IN_FULL:
        texts = [text for tap_id in stored.fresh for text in measurement_texts(logbook.measurement(tap_id), logbook)]
    else:
        rows = logbook.history.rows
        asked = {row.tap_id: row.questions for row in rows}
        questions = about_questions(asked, logbook.folder.path, [tap_id for tap_id in stored.fresh if tap_id in asked])
        texts = [_summed_up([row for row in rows if row.tap_id in fresh])]
        texts += [f"asked of {question.finding}" for question in questions]
    if stored.taken:
        texts.append(f"taken where the files do not say: {', '.join(stored.taken)}")
    return [*texts, *(program_texts(logbook) if fresh else [])]


def _summed_up(shown: Sequence[Row]) -> Table:
    """A line for each tool and direction."""
    series: dict[tuple[str, str], list[Row]] = {}
    for row in shown:
        series.setdefault((row.tool, row.direction), []).append(row)
    rows = table("<tool", "<direction", "tests", "<from", "<to", "~frequency (Hz)", "~damping (%)", "~stiffness (N/um)")
    for (tool, direction), tests in series.items():
        modes = [row.mode for row in tests if row.mode is not None]
        ends = (modes[0], modes[-1]) if modes else ()
        values = [
            " .. ".join(text % value for value in values)
            for text, values in (
                ("%.1f", [mode.frequency for mode in ends]),
                ("%.2f", [100 * mode.damping_ratio for mode in ends]),
                ("%.1f", [mode.stiffness / 1e6 for mode in ends if mode.has_stiffness]),
            )
        ]
        days = f"{tests[0].time:%Y-%m-%d}", f"{tests[-1].time:%Y-%m-%d}"
        rows.add_row(tool, direction, str(len(tests)), *days, *values)
    return rows
