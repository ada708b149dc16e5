"""The recordings of test cuts against what was written, and their mending."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from pathlib import Path

from acquisition import DataError, Remark
from acquisition.files.cut_file import read_cut_signal
from lobewatch.machine.contents import fault_of
from lobewatch.machine.journal.heard_cut import HeardCut, RecordedAs, cut_of_line


def about_cuts(folder: Path, cuts: Sequence[HeardCut], given_up: Collection[str], mend: str) -> Iterator[Remark]:
    """What is wrong with them; mend: the command that puts it right."""
    for cut in cuts:
        wrong = _fault(folder, cut.recording)
        if not wrong or cut.recording is None:
            continue
        told = f"{wrong}; what was heard in it counts"
        if cut.id in given_up:
            yield Remark("cut-lost", cut.recording.file, told)
        else:
            cure = f"put it back from a backup; without one, {mend} goes on without it"
            yield Remark("cut-damaged", cut.recording.file, told, cure)
    for path in unlisted_cuts(folder, cuts):
        yield Remark("cut-unlisted", f"cuts/{path.name}", "not in the journal, does not count", f"{mend} looks into it")


def unlisted_cuts(folder: Path, cuts: Sequence[HeardCut]) -> list[Path]:
    """Files in cuts/ without a line, none that is being written."""
    known = {f"{cut.id}.h5" for cut in cuts if cut.recording is not None}
    found = sorted((folder / "cuts").glob("*")) if (folder / "cuts").is_dir() else []
    return [path for path in found if path.name not in known and not path.name.startswith(".")]


def damaged_cuts(folder: Path, cuts: Sequence[HeardCut]) -> list[RecordedAs]:
    """The recordings that are not as they were written."""
    return [cut.recording for cut in cuts if cut.recording is not None and _fault(folder, cut.recording)]


def read_unlisted(path: Path) -> HeardCut | None:
    """The test cut that a recording without a line is of; None where it is no whole one, or has another name."""
    try:
        _, about = read_cut_signal(path)
        cut = cut_of_line(about)
    except (DataError, OSError, LookupError, TypeError, ValueError):
        return None
    return cut if f"{cut.id}.h5" == path.name else None


def _fault(folder: Path, recording: RecordedAs | None) -> str:
    return "" if recording is None else fault_of(folder, recording)
