"""Preview what a replay would make of recorded files, without storing anything."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path

from acquisition import Circumstances, Description, Recording, TapTest
from lobewatch.history.history import to_mode_values
from lobewatch.history.series_reference import find_earlier_tests
from lobewatch.logbook.logbook import Logbook
from lobewatch.logbook.recordings.prepare_taps import (
    InterpretedFile,
    explain_file_error,
    interpret_content,
    is_valid_interpretation,
    work_on_files,
)
from lobewatch.logbook.recordings.store_recordings import LOCAL_WORKERS, ProgressCallback, ReplayPlan
from lobewatch.measurement.recording_questions import find_open_questions
from lobewatch.measurement.series_questions import MAX_DAY, EarlierTest, SeriesReference
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
    earlier: dict[tuple[str, str], _EarlierTests] = {}
    for i, preview in enumerate(previews):
        previews[i] = _measure_preview(logbook, preview, earlier)
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


@dataclass
class _EarlierTests:
    """Earlier tests of one tool and direction, stored or previewed."""

    tests: list[EarlierTest]
    """Followed modes without open questions, oldest first."""
    mode: Mode | None
    """Newest followed mode."""
    time: datetime | None = None
    """Time of the newest test; None without one."""
    frequencies: tuple[float, ...] = ()
    """Frequencies of all its modes (Hz)."""

    def add(self, measurement: Measurement) -> None:
        """Add a previewed test."""
        self.time, self.frequencies = measurement.time, tuple(mode.frequency for mode in measurement.modes)
        followed = measurement.followed
        if followed is None:
            return
        self.mode = followed
        if not find_open_questions(measurement.remarks):
            values = followed.frequency, followed.stiffness
            self.tests.append(EarlierTest(measurement.time, *values, modes=to_mode_values(measurement.modes)))


def _measure_preview(
    logbook: Logbook, preview: ReplayPreview, earlier: dict[tuple[str, str], _EarlierTests]
) -> ReplayPreview:
    """Measure a tap test to preview. `earlier` holds the tests of each tool and direction so far."""
    if preview.tap is None or preview.fit is None:
        return preview
    about = preview.tap.circumstances
    names = about.direction, "x" if about.direction == "y" else "y"
    for name in names:
        if (about.tool, name) not in earlier:
            earlier[about.tool, name] = _find_stored(logbook, about, name)
    own, across = (earlier[about.tool, name] for name in names)
    is_same_day = across.time is not None and abs(about.created - across.time) <= MAX_DAY
    frequencies = across.frequencies if is_same_day else ()
    reference = SeriesReference(tuple(own.tests), tuple(across.tests), frequencies)
    measurement = interpret_fit(preview.fit, logbook.machine, own.mode, reference)
    own.add(measurement)
    return replace(preview, measurement=measurement)


def _find_stored(logbook: Logbook, about: Circumstances, direction: str) -> _EarlierTests:
    """Find the stored tests of a tool and direction that are older than a test."""
    rows = [row for row in logbook.history.rows if (row.tool, row.direction) == (about.tool, direction)]
    rows = [row for row in rows if row.time < about.created]
    modes = [row.mode for row in rows if row.mode is not None and not row.questions]
    current = [row for row in rows if row.baseline == logbook.history.baseline]
    found = _EarlierTests([*find_earlier_tests(current)], modes[-1] if modes else None)
    if rows:
        found.time, found.frequencies = rows[-1].time, tuple(mode[0] for mode in rows[-1].modes)
    return found
