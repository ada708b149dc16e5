"""What a replay would make of recorded files; nothing is stored."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from acquisition import DataError, Description, Recording, TapTest
from lobewatch.analysis.logbook import Logbook
from lobewatch.analysis.measurement import Measurement, measure
from lobewatch.analysis.replaying.read_tap_test import Setup, read_tap_test
from lobewatch.analysis.replaying.store import KnownContents, Progress
from lobewatch.analysis.replaying.worked_out import reason_of
from modal import Mode


@dataclass(frozen=True, eq=False)
class Preview:
    """What would become of one file."""

    file: Path
    """Where it lies."""
    known: str = ""
    """The tap test that it is stored as already."""
    refused: str = ""
    """Why it cannot be used, and what to say of it."""
    recording: Recording | None = None
    """How it is understood."""
    tap: TapTest | None = None
    """The tap test that it would be."""
    measurement: Measurement | None = None
    """What that says; its remarks hold the questions that would be asked."""


def preview_recordings(
    logbook: Logbook,
    files: Sequence[Path],
    said: Description,
    progress: Progress = lambda _what, _done, _of: None,
) -> list[Preview]:
    """One a file, in order of date; those that cannot be used or are stored already first."""
    contents, found = KnownContents.of(logbook.folder.taps()), list[Preview]()
    for number, file in enumerate(files, 1):
        found.append(_read(logbook, file, said, contents))
        progress("read", number, len(files))
    first = [one for one in found if one.tap is None]
    found = first + sorted((one for one in found if one.tap is not None), key=_time)
    last: dict[tuple[str, str], Mode] = {}
    measured = list[Preview]()
    for number, one in enumerate(found, 1):
        measured.append(one if one.tap is None else _measured(logbook, one, one.tap, last))
        progress("measure", number, len(files))
    return measured


def _time(one: Preview) -> float:
    return one.tap.circumstances.created.timestamp() if one.tap else 0.0


def _read(logbook: Logbook, file: Path, said: Description, contents: KnownContents) -> Preview:
    try:
        content = file.read_bytes()
        digest = hashlib.sha256(content).hexdigest()
        known = contents.tap_of(digest, said)
        if known is not None:
            return Preview(file, known)
        tap, recording = read_tap_test(Setup.of(logbook.folder), file, said, content)
    except (DataError, OSError, ValueError) as error:
        return Preview(file, refused=reason_of(file, error))
    contents.add(digest, tap)
    return Preview(file, recording=recording, tap=tap)


def _measured(logbook: Logbook, one: Preview, tap: TapTest, last: dict[tuple[str, str], Mode]) -> Preview:
    """last: the mode followed in the newest file before it of each tool and direction."""
    series = (tap.circumstances.tool, tap.circumstances.direction)
    before = last.get(series) or _stored_before(logbook, tap)
    found = measure(tap, logbook.machine, before)
    if found.followed is not None:
        last[series] = found.followed
    return Preview(one.file, recording=one.recording, tap=tap, measurement=found)


def _stored_before(logbook: Logbook, tap: TapTest) -> Mode | None:
    """The mode that the newest stored tap test before it of the same series follows."""
    about = tap.circumstances
    rows = [row for row in logbook.history.rows if (row.tool, row.direction) == (about.tool, about.direction)]
    known = [row.mode for row in rows if row.time < about.created and row.mode is not None and not row.questions]
    return known[-1] if known else None
