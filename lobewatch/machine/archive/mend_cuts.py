"""cuts/ put right as far as its sound files allow; what is damaged is put out of the way, never deleted."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

from lobewatch.machine.archive.verify_cuts import damaged_cuts, read_unlisted, unlisted_cuts
from lobewatch.machine.contents import given_up, heard
from lobewatch.machine.journal.heard_cut import RecordedAs
from lobewatch.machine.journal.journal import Journal


def mend_cuts(folder: Path, journal: Journal, put_aside: Callable[[Path], Path]) -> Iterator[str]:
    """Whole recordings without a line are entered, others put aside; what was done, a sentence each.

    What was heard in a recording that is lost stands in its line and goes on to count.
    """
    for path in unlisted_cuts(folder, heard(journal.read())):
        cut = read_unlisted(path)
        if cut is None or cut.id in {one.id for one in heard(journal.read())}:
            yield f"cuts/{path.name}: put into {put_aside(path).relative_to(folder).as_posix()}"
            continue
        content = path.read_bytes()
        recording = RecordedAs(cut.id, hashlib.sha256(content).hexdigest(), len(content))
        journal.append(replace(cut, recording=recording).line | {"time": datetime.now(UTC).isoformat()})
        yield f"cuts/{path.name}: entered in the journal"
    reading = journal.read()
    for lost in damaged_cuts(folder, heard(reading)):
        if (folder / lost.file).exists():
            put_aside(folder / lost.file)
        if lost.id not in given_up(reading):
            journal.append({"kind": "lost", "tap": lost.id, "time": datetime.now(UTC).isoformat()})
            yield f"{lost.file}: lost; what was heard in it goes on to count"
