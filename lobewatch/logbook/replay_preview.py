"""Preview what a replay would make of recorded files, without storing anything."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from acquisition import DataError, Description, Recording, TapTest
from lobewatch.logbook.logbook import Logbook
from lobewatch.logbook.recordings.prepare_taps import (
    FileRequest,
    InterpretedFile,
    explain_file_error,
    interpret_file,
    interpret_request,
    is_valid_interpretation,
)
from lobewatch.logbook.recordings.store_recordings import (
    LOCAL_WORKERS,
    ReplayProgressCallback,
    StoredContents,
    compute_digests,
)
from lobewatch.measurement.share_work import Workers, share_work
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
    measurement: Measurement | None = None
    """Measurement of this tap test. Its remarks include the questions that it raises."""


def preview_replay(
    logbook: Logbook,
    files: Sequence[Path],
    description: Description,
    progress: ReplayProgressCallback = lambda _what, _done, _of: None,
    workers: Workers = LOCAL_WORKERS,
) -> list[ReplayPreview]:
    """Preview the replay of recorded files, in order of date; rejected and stored files come first.

    The result does not depend on the workers.
    """
    read_files = sorted(_read_recordings(logbook, files, description, progress, workers), key=_recorded_time)
    newest_modes: dict[tuple[str, str], Mode] = {}
    previews = list[ReplayPreview]()
    for number, (preview, fit) in enumerate(read_files, 1):
        previews.append(_measure_preview(logbook, preview, fit, newest_modes))
        progress("measure", number, len(files))
    return previews


def _recorded_time(read_file: tuple[ReplayPreview, TapFit | None]) -> float:
    tap = read_file[0].tap
    return tap.circumstances.created.timestamp() if tap else -math.inf


def _read_recordings(
    logbook: Logbook,
    files: Sequence[Path],
    description: Description,
    progress: ReplayProgressCallback,
    workers: Workers,
) -> Iterator[tuple[ReplayPreview, TapFit | None]]:
    """Read each content once and yield a preview of each file, in the order of the files."""
    contents, todo = StoredContents.of(logbook.folder.taps()), dict[str, Path]()
    digests, unread = compute_digests(files)
    for file, digest in digests.items():
        if contents.find_tap(digest, description) is None:
            todo.setdefault(digest, file)
    results = dict[str, InterpretedFile | str]()
    for digest, result in zip(todo, _interpret_all(logbook, [*todo.values()], description, workers), strict=True):
        results[digest] = result
        progress("read", len(results), len(todo))
    for file in files:
        digest = digests.get(file, "")
        answer = explain_file_error(file, unread[file]) if file in unread else results.get(digest)
        if answer is None:
            yield ReplayPreview(file, stored_tap_id=contents.find_tap(digest, description) or ""), None
        elif isinstance(answer, str):
            yield ReplayPreview(file, rejection=answer), None
        elif todo[digest] != file:
            yield ReplayPreview(file, stored_tap_id=answer.tap.id), None
        else:
            yield ReplayPreview(file, recording=answer.recording, tap=answer.tap), answer.fit


def _interpret_all(
    logbook: Logbook, files: Sequence[Path], description: Description, workers: Workers
) -> Iterator[InterpretedFile | str]:
    """Yield the interpretation of each file, or the reason why it cannot be used. Errors as `share_work`."""
    if workers.use_other_processes:
        toml = logbook.folder.toml_text
        requests = (FileRequest.of(file, description, toml) for file in files)
        yield from share_work(interpret_request, requests, workers, is_valid_interpretation)
        return
    for file in files:
        try:
            yield interpret_file(logbook.folder, file, description)
        except (DataError, OSError, ValueError) as error:
            yield explain_file_error(file, error)


def _measure_preview(
    logbook: Logbook, preview: ReplayPreview, fit: TapFit | None, newest_modes: dict[tuple[str, str], Mode]
) -> ReplayPreview:
    """Measure a tap test to preview. `newest_modes` holds the newest followed mode of each tool and direction."""
    if preview.tap is None or fit is None:
        return preview
    series = (preview.tap.circumstances.tool, preview.tap.circumstances.direction)
    before = newest_modes.get(series) or _find_earlier_mode(logbook, preview.tap)
    measurement = interpret_fit(fit, logbook.machine, before)
    if measurement.followed is not None:
        newest_modes[series] = measurement.followed
    return replace(preview, measurement=measurement)


def _find_earlier_mode(logbook: Logbook, tap: TapTest) -> Mode | None:
    """Find the followed mode of the newest earlier tap test of the same series."""
    about = tap.circumstances
    rows = [row for row in logbook.history.rows if (row.tool, row.direction) == (about.tool, about.direction)]
    modes = [row.mode for row in rows if row.time < about.created and row.mode is not None and not row.questions]
    return modes[-1] if modes else None
