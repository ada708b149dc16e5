"""A test cut written down: its recording where there is one, then its line, which is the commit."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from datetime import UTC, datetime
from importlib.metadata import version

from acquisition.atomic import make_folder
from acquisition.files.cut_file import CutSignal, write_cut_signal
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.journal.heard_cut import KIND, HeardCut, RecordingFile
from lobewatch.machine.journal.journal import Reading


def software() -> str:
    """Version of lobewatch."""
    return f"lobewatch {version('lobewatch')}"


def keep_cut(folder: MachineFolder, cut: HeardCut, signal: CutSignal | None = None) -> HeardCut:
    """Write down a test cut, first its recording, then its line; saved for good when this returns.

    Returns it with its identity. DataError where the journal is damaged, BusyError where another program writes.
    """
    with folder.locked():
        reading = folder.refuse_damage()
        named = replace(cut, id=_next_id(folder, reading))
        if signal is not None:
            path = folder.path / "cuts" / f"{named.id}.h5"
            make_folder(path.parent)
            content = write_cut_signal(path, signal, named.line)
            digest = hashlib.sha256(content).hexdigest()
            named = replace(named, recording=RecordingFile(named.id, digest, len(content)))
        folder.journal.append(named.line | {"time": datetime.now(UTC).isoformat()}, reading=reading)
    return named


def _next_id(folder: MachineFolder, reading: Reading) -> str:
    """First identity that neither a line nor a file has had."""
    lines = [line["id"] for line in reading.others if line["kind"] == KIND]
    files = [path.stem for path in (folder.path / "cuts").glob("c*.h5")]
    numbers = [int(name[1:]) for name in (*lines, *files) if name[1:].isdigit()]
    return f"c{max(numbers, default=0) + 1}"
