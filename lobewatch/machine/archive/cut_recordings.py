"""The recordings of test cuts against what was written, and their mending."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

from acquisition import DataError, Remark
from acquisition.files.cut_file import read_cut_signal
from acquisition.regular_file import read_regular
from lobewatch.machine.contents import committed_cuts, fault_of, ids_given_up
from lobewatch.machine.journal.heard_cut import HeardCut, RecordingFile, cut_of_line
from lobewatch.machine.journal.journal import Journal


def verify_cuts(folder: Path, cuts: Sequence[HeardCut], given_up: Collection[str], mend: str) -> Iterator[Remark]:
    """Remarks on recordings that are altered, missing or unlisted; mend: the command that puts them right."""
    for cut in cuts:
        fault = _fault(folder, cut.recording)
        if not fault or cut.recording is None:
            continue
        text = f"{fault}; what was heard in it counts"
        if cut.id in given_up:
            yield Remark("cut-lost", cut.recording.file, text)
        else:
            cure = f"put it back from a backup; without one, {mend} goes on without it"
            yield Remark("cut-damaged", cut.recording.file, text, cure)
    for path in _unlisted_cuts(folder, cuts):
        yield Remark("cut-unlisted", f"cuts/{path.name}", "not in the journal, does not count", f"{mend} looks into it")


def mend_cuts(folder: Path, journal: Journal, put_aside: Callable[[Path], Path]) -> Iterator[str]:
    """Enter whole recordings without a line, put others aside, delete none; what was done, a sentence each.

    What was heard in a recording that is lost stands in its line and goes on to count.
    """
    for path in _unlisted_cuts(folder, committed_cuts(journal.read())):
        cut = _read_unlisted(path)
        if cut is None or cut.id in {entered.id for entered in committed_cuts(journal.read())}:
            yield f"cuts/{path.name}: put into {put_aside(path).relative_to(folder).as_posix()}"
            continue
        content = read_regular(path)
        recording = RecordingFile(cut.id, hashlib.sha256(content).hexdigest(), len(content))
        journal.append(replace(cut, recording=recording).line | {"time": datetime.now(UTC).isoformat()})
        yield f"cuts/{path.name}: entered in the journal"
    reading = journal.read()
    for lost in _damaged_recordings(folder, committed_cuts(reading)):
        if (folder / lost.file).exists():
            put_aside(folder / lost.file)
        if lost.id not in ids_given_up(reading):
            journal.append({"kind": "lost", "tap": lost.id, "time": datetime.now(UTC).isoformat()})
            yield f"{lost.file}: lost; what was heard in it goes on to count"


def _unlisted_cuts(folder: Path, cuts: Sequence[HeardCut]) -> list[Path]:
    """Files in cuts/ without a line, none that is being written."""
    listed = {f"{cut.id}.h5" for cut in cuts if cut.recording is not None}
    files = sorted((folder / "cuts").glob("*")) if (folder / "cuts").is_dir() else []
    return [path for path in files if path.name not in listed and not path.name.startswith(".")]


def _damaged_recordings(folder: Path, cuts: Sequence[HeardCut]) -> list[RecordingFile]:
    return [cut.recording for cut in cuts if cut.recording is not None and _fault(folder, cut.recording)]


def _read_unlisted(path: Path) -> HeardCut | None:
    """The test cut that a recording without a line is of; None where it is no whole one, or has another name."""
    try:
        _, about = read_cut_signal(path)
        cut = cut_of_line(about)
    except (DataError, OSError, LookupError, TypeError, ValueError):
        return None
    return cut if f"{cut.id}.h5" == path.name else None


def _fault(folder: Path, recording: RecordingFile | None) -> str:
    return "" if recording is None else fault_of(folder, recording)
