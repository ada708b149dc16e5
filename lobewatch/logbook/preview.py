"""What a replay would make of recorded files; nothing is stored."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from acquisition import DataError, Description, Recording, TapTest
from lobewatch.logbook.logbook import Logbook
from lobewatch.logbook.replaying.store import HERE, KnownContents, Progress, digests_of
from lobewatch.logbook.replaying.tap_draft import (
    FileReading,
    FileRequest,
    is_reading,
    read_file,
    read_requested_file,
    reason_of,
)
from lobewatch.measuring.measurement import Measurement, TapFit, interpret_fit
from lobewatch.measuring.workers.share_work import Workers, share_work
from modal import Mode


@dataclass(frozen=True, eq=False)
class Preview:
    """What would become of one file."""

    file: Path
    """Path of the file."""
    known: str = ""
    """The tap test that it is stored as already."""
    refused: str = ""
    """Reason why it cannot be used, and what to say of it."""
    recording: Recording | None = None
    """Recording as it is understood."""
    tap: TapTest | None = None
    """The tap test that it would be."""
    measurement: Measurement | None = None
    """Measurement of that; its remarks hold the questions that would be asked."""


def preview_recordings(
    logbook: Logbook,
    files: Sequence[Path],
    description: Description,
    progress: Progress = lambda _what, _done, _of: None,
    workers: Workers = HERE,
) -> list[Preview]:
    """One a file, in order of date; those that cannot be used or are stored already first.

    workers: who reads and fits; what they find is the same.
    """
    read_files, fits = list[Preview](), dict[Path, TapFit]()
    for preview, fit in _read(logbook, files, description, progress, workers):
        read_files.append(preview)
        fits |= {preview.file: fit} if fit is not None else {}
    read_files.sort(key=_time)
    last: dict[tuple[str, str], Mode] = {}
    previews = list[Preview]()
    for number, preview in enumerate(read_files, 1):
        tap = preview.tap
        previews.append(preview if tap is None else _measured(logbook, preview, tap, fits[preview.file], last))
        progress("measure", number, len(files))
    return previews


def _time(preview: Preview) -> float:
    return preview.tap.circumstances.created.timestamp() if preview.tap else -math.inf


def _read(
    logbook: Logbook, files: Sequence[Path], description: Description, progress: Progress, workers: Workers
) -> Iterator[tuple[Preview, TapFit | None]]:
    """Each content once; in the order of the files."""
    contents, todo = KnownContents.of(logbook.folder.taps()), dict[str, Path]()
    digests, unread = digests_of(files)
    for file, digest in digests.items():
        if contents.tap_of(digest, description) is None:
            todo.setdefault(digest, file)
    results = dict[str, FileReading | str]()
    for digest, understood in zip(todo, _all_understood(logbook, [*todo.values()], description, workers), strict=True):
        results[digest] = understood
        progress("read", len(results), len(todo))
    for file in files:
        digest = digests.get(file, "")
        result = reason_of(file, unread[file]) if file in unread else results.get(digest)
        if result is None:
            yield Preview(file, known=contents.tap_of(digest, description) or ""), None
        elif isinstance(result, str):
            yield Preview(file, refused=result), None
        elif todo[digest] != file:
            yield Preview(file, known=result.tap.id), None
        else:
            yield Preview(file, recording=result.recording, tap=result.tap), result.fit


def _all_understood(
    logbook: Logbook, files: Sequence[Path], description: Description, workers: Workers
) -> Iterator[FileReading | str]:
    """Each file in turn, or why it cannot be used; DataError as `share_work`."""
    if workers.are_elsewhere:
        toml = logbook.folder.toml_text
        asked = (FileRequest.of(file, description, toml) for file in files)
        yield from share_work(read_requested_file, asked, workers, is_reading)
        return
    for file in files:
        try:
            yield read_file(logbook.folder, file, description)
        except (DataError, OSError, ValueError) as error:
            yield reason_of(file, error)


def _measured(
    logbook: Logbook, preview: Preview, tap: TapTest, fit: TapFit, last: dict[tuple[str, str], Mode]
) -> Preview:
    """last: the mode followed in the newest file before it of each tool and direction."""
    series = (tap.circumstances.tool, tap.circumstances.direction)
    before = last.get(series) or _stored_before(logbook, tap)
    measurement = interpret_fit(fit, logbook.machine, before)
    if measurement.followed is not None:
        last[series] = measurement.followed
    return replace(preview, measurement=measurement)


def _stored_before(logbook: Logbook, tap: TapTest) -> Mode | None:
    """The mode that the newest stored tap test before it of the same series follows."""
    about = tap.circumstances
    rows = [row for row in logbook.history.rows if (row.tool, row.direction) == (about.tool, about.direction)]
    modes = [row.mode for row in rows if row.time < about.created and row.mode is not None and not row.questions]
    return modes[-1] if modes else None
