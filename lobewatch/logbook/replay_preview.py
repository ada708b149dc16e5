"""Preview what a replay would make of recorded files, without storing anything."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from acquisition import Description, Recording, TapTest
from lobewatch.logbook.logbook import Logbook
from lobewatch.logbook.recordings.prepare_taps import (
    InterpretedFile,
    explain_file_error,
    interpret_content,
    is_valid_interpretation,
    work_on_files,
)
from lobewatch.logbook.recordings.store_recordings import LOCAL_WORKERS, ProgressCallback, ReplayPlan
from lobewatch.measurement.share_work import Workers
from lobewatch.measurement.tap_measurement import Measurement, TapFit, interpret_fit
from modal import Mode


@dataclass(frozen=True, eq=False)
class ReplayPreview:
    """Preview of the replay of one file."""

    file: Path
    """Path of the file."""
    stored_tap_id: str = ""
    """Identity of the tap test, if the file is stored already."""
    rejection: str = ""
    """Reason why the file cannot be used."""
    recording: Recording | None = None
    """Recording with its facts."""
    tap: TapTest | None = None
    """Tap test that a replay would store."""
    fit: TapFit | None = None
    """Fitted modes."""
    measurement: Measurement | None = None
    """Measurement of this tap test. Its remarks include the questions that it raises."""


def preview_replay(
    logbook: Logbook,
    files: Sequence[Path],
    description: Description,
    progress: ProgressCallback = lambda _what, _done, _of: None,
    workers: Workers = LOCAL_WORKERS,
) -> list[ReplayPreview]:
    """Preview the replay of recorded files, in order of date; rejected and stored files come first.

    The result does not depend on the workers.
    """
    previews = sorted(_read_recordings(logbook, files, description, progress, workers), key=_recorded_time)
    newest_modes: dict[tuple[str, str], Mode] = {}
    for i, preview in enumerate(previews):
        previews[i] = _measure_preview(logbook, preview, newest_modes)
        progress("measure", i + 1, len(files))
    return previews


def _recorded_time(preview: ReplayPreview) -> float:
    return preview.tap.circumstances.created.timestamp() if preview.tap else -math.inf


def _read_recordings(
    logbook: Logbook, files: Sequence[Path], description: Description, progress: ProgressCallback, workers: Workers
) -> Iterator[ReplayPreview]:
    """Read each content once and yield a preview of each file, in the order of the files."""
    digests, unread, stored, new = ReplayPlan.of(logbook.folder, files, description)
    results, paths = dict[str, InterpretedFile | str](), [*new.values()]
    answers = work_on_files(logbook.folder, paths, description, workers, interpret_content, is_valid_interpretation)
    for digest, answer in zip(new, answers, strict=True):
        results[digest] = answer
        progress("read", len(results), len(new))
    for file in files:
        digest = digests.get(file, "")
        result = explain_file_error(file, unread[file]) if file in unread else results.get(digest)
        if result is None:
            logbook.read_decided(stored[digest], description.hit_decisions)
            yield ReplayPreview(file, stored_tap_id=stored[digest])
        elif isinstance(result, str):
            yield ReplayPreview(file, rejection=result)
        elif new[digest] != file:
            yield ReplayPreview(file, stored_tap_id=result.tap.id)
        else:
            yield ReplayPreview(file, recording=result.recording, tap=result.tap, fit=result.fit)


def _measure_preview(
    logbook: Logbook, preview: ReplayPreview, newest_modes: dict[tuple[str, str], Mode]
) -> ReplayPreview:
    """Measure a tap test to preview. `newest_modes` holds the newest followed mode of each tool and direction."""
    if preview.tap is None or preview.fit is None:
        return preview
    series = (preview.tap.circumstances.tool, preview.tap.circumstances.direction)
    before = newest_modes.get(series) or _find_earlier_mode(logbook, preview.tap)
    measurement = interpret_fit(preview.fit, logbook.machine, before)
    if measurement.followed is not None:
        newest_modes[series] = measurement.followed
    return replace(preview, measurement=measurement)


def _find_earlier_mode(logbook: Logbook, tap: TapTest) -> Mode | None:
    """Find the followed mode of the newest earlier tap test of the same series."""
    about = tap.circumstances
    rows = [row for row in logbook.history.rows if (row.tool, row.direction) == (about.tool, about.direction)]
    modes = [row.mode for row in rows if row.time < about.created and row.mode is not None and not row.questions]
    return modes[-1] if modes else None
