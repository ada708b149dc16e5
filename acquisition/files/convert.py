"""A recorded file written in a format that other programs read."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from acquisition.atomic import atomic_write
from acquisition.errors import DataError
from acquisition.files.contents.description import Description
from acquisition.files.contents.exponential import window_text
from acquisition.files.contents.recording import Recording
from acquisition.files.read_recording import look, read_frf
from acquisition.files.writers.labels import Labels
from acquisition.files.writers.write_mat import mat_of_frf, mat_of_hits
from acquisition.files.writers.write_sep005 import sep005_of_hits
from acquisition.files.writers.write_table import table_of_frf, table_of_hits
from acquisition.files.writers.write_uff import uff_of_frf, uff_of_hits
from acquisition.frf import Frf
from acquisition.hit import Hit


@dataclass(frozen=True)
class Writer:
    """How a format is written."""

    title: str
    """Name of the format for people."""
    of_hits: Callable[[Sequence[Hit], Labels], bytes]
    """Function that writes signals over time."""
    of_frf: Callable[[Frf, Labels], bytes] | None
    """Function that writes an FRF; None where the format has none."""
    precision: str
    """Precision of its numbers, for people."""


_UFF = Writer("universal file", uff_of_hits, uff_of_frf, "12 digits")
WRITERS = {
    ".uff": _UFF,
    ".unv": _UFF,
    ".csv": Writer("text table", table_of_hits, table_of_frf, "17 digits"),
    ".mat": Writer("MATLAB file", mat_of_hits, mat_of_frf, "double precision"),
    ".json": Writer("SDyPy SEP005 time series", sep005_of_hits, None, "17 digits"),
}
"""By the extension of the file that is written."""


@dataclass(frozen=True)
class Converted:
    """What was written."""

    path: Path
    """Path of the new file."""
    title: str
    """Name of its format, for people."""
    what: str
    """FRF or hits, for people."""
    precision: str
    """Precision of its numbers, for people."""
    recording: Recording
    """Recording that it was made from."""


def convert(path: Path | str, out: Path | str, said: Description, *, hits: bool = False) -> Converted:
    """Write the FRF of a recorded file, or its hits, in the format that the extension of `out` names.

    hits: the signals over time; a format without FRFs has them anyway. DataError for a file that does not say enough or
    does not hold what is asked for; ValueError for an extension that no format has.
    """
    path, out = Path(path), Path(out)
    writer = WRITERS.get(out.suffix.lower())
    if writer is None:
        raise ValueError(f"{out}: files that end with {', '.join(WRITERS)} are written; give one of them")
    if out.exists() and path.exists() and out.samefile(path):
        raise ValueError(f"{out}: this is the file that is read; name another")
    recording = look(path, said).checked()
    labels = Labels(
        said.date.astimezone() if said.date else recording.created,
        said.direction or recording.direction,
        said.tool or recording.tool,
        path.name,
        window_text(recording.window),
    )
    if writer.of_frf is not None and not hits:
        frf = recording.frf or read_frf(path, said)
        content, amount = writer.of_frf(frf, labels), f"FRF of {frf.frequency.size} lines"
    elif recording.hits:
        content, amount = writer.of_hits(recording.hits, labels), f"{len(recording.hits)} hit(s)"
    else:
        raise DataError(f"{path}: holds an FRF, not the hits it was made from; write it as {', '.join(_OF_FRF)}")
    atomic_write(out, content)
    return Converted(out, writer.title, amount, writer.precision, recording)


_OF_FRF = [extension for extension, writer in WRITERS.items() if writer.of_frf]
