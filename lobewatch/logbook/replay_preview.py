"""Preview what a replay would make of recorded files, without storing anything."""

from __future__ import annotations

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
    """What would become of one file."""

    file: Path
    """Path of the file."""
    stored_tap_id: str = ""
    """The tap test that it is stored as already."""
    rejection: str = ""
    """Reason why it cannot be used, and what to say of it."""
    recording: Recording | None = None
    """Recording as it is understood."""
    tap: TapTest | None = None
    """The tap test that it would be."""
    measurement: Measurement | None = None
    """Measurement of that; its remarks hold the questions that would be asked."""


def preview_replay(
    logbook: Logbook,
    files: Sequence[Path],
    description: Description,
    progress: ReplayProgressCallback = lambda _what, _done, _of: None,
    workers: Workers = LOCAL_WORKERS,
) -> list[ReplayPreview]:
    """One a file, in order of date; those that cannot be used or are stored already first.

    workers: who reads and fits; what they find is the same.
    """
    read_files, fits = list[ReplayPreview](), dict[Path, TapFit]()
    for preview, fit in _read_recordings(logbook, files, description, progress, workers):
        read_files.append(preview)
        fits |= {preview.file: fit} if fit is not None else {}
    read_files.sort(key=_recorded_time)
    last: dict[tuple[str, str], Mode] = {}
    previews = list[ReplayPreview]()
    for number, preview in enumerate(read_files, 1):
        tap = preview.tap
        previews.append(preview if tap is None else _measure_preview(logbook, preview, tap, fits[preview.file], last))
        progress("measure", number, len(files))
    return previews


def _recorded_time(preview: ReplayPreview) -> float:
    return preview.tap.circumstances.created.timestamp() if preview.tap else -math.inf


def _read_recordings(
    logbook: Logbook,
    files: Sequence[Path],
    description: Description,
    progress: ReplayProgressCallback,
    workers: Workers,
) -> Iterator[tuple[ReplayPreview, TapFit | None]]:
    """Each content once; in the order of the files."""
    contents, todo = StoredContents.of(logbook.folder.taps()), dict[str, Path]()
    digests, unread = compute_digests(files)
    for file, digest in digests.items():
        if contents.find_tap(digest, description) is None:
            todo.setdefault(digest, file)
    results = dict[str, InterpretedFile | str]()
    for digest, understood in zip(todo, _interpret_all(logbook, [*todo.values()], description, workers), strict=True):
        results[digest] = understood
        progress("read", len(results), len(todo))
    for file in files:
        digest = digests.get(file, "")
        result = explain_file_error(file, unread[file]) if file in unread else results.get(digest)
        if result is None:
            yield ReplayPreview(file, stored_tap_id=contents.find_tap(digest, description) or ""), None
        elif isinstance(result, str):
            yield ReplayPreview(file, rejection=result), None
        elif todo[digest] != file:
            yield ReplayPreview(file, stored_tap_id=result.tap.id), None
        else:
            yield ReplayPreview(file, recording=result.recording, tap=result.tap), result.fit


def _interpret_all(
    logbook: Logbook, files: Sequence[Path], description: Description, workers: Workers
) -> Iterator[InterpretedFile | str]:
    """Each file in turn, or why it cannot be used; DataError as `share_work`."""
    if workers.use_other_processes:
        toml = logbook.folder.toml_text
        asked = (FileRequest.of(file, description, toml) for file in files)
        yield from share_work(interpret_request, asked, workers, is_valid_interpretation)
        return
    for file in files:
        try:
            yield interpret_file(logbook.folder, file, description)
        except (DataError, OSError, ValueError) as error:
            yield explain_file_error(file, error)


def _measure_preview(
    logbook: Logbook, preview: ReplayPreview, tap: TapTest, fit: TapFit, last: dict[tuple[str, str], Mode]
) -> ReplayPreview:
    """last: the mode followed in the newest file before it of each tool and direction."""
    series = (tap.circumstances.tool, tap.circumstances.direction)
    before = last.get(series) or _find_earlier_mode(logbook, tap)
    measurement = interpret_fit(fit, logbook.machine, before)
    if measurement.followed is not None:
        last[series] = measurement.followed
    return replace(preview, measurement=measurement)


def _find_earlier_mode(logbook: Logbook, tap: TapTest) -> Mode | None:
    """The mode that the newest stored tap test before it of the same series follows."""
    about = tap.circumstances
    rows = [row for row in logbook.history.rows if (row.tool, row.direction) == (about.tool, about.direction)]
    modes = [row.mode for row in rows if row.time < about.created and row.mode is not None and not row.questions]
    return modes[-1] if modes else None
