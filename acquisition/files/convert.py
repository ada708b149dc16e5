"""A recorded file written in a format that other programs read."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from acquisition.errors import DataError
from acquisition.file_io import atomic_write
from acquisition.files.contents.contents import format_window
from acquisition.files.contents.description import Description
from acquisition.files.contents.recording import Recording
from acquisition.files.read_recording import inspect_file, read_frf
from acquisition.files.writers import (
    ExportLabels,
    encode_mat_frf,
    encode_mat_hits,
    encode_sep005_hits,
    encode_table_frf,
    encode_table_hits,
    encode_uff_frf,
    encode_uff_hits,
)
from acquisition.frf import Frf
from acquisition.hit import Hit


@dataclass(frozen=True)
class ExportFormat:
    """How a format is written."""

    title: str
    """Name of the format for people."""
    encode_hits: Callable[[Sequence[Hit], ExportLabels], bytes]
    """Function that writes signals over time."""
    encode_frf: Callable[[Frf, ExportLabels], bytes] | None
    """Function that writes an FRF; None where the format has none."""
    precision: str
    """Precision of its numbers, for people."""


_UFF_EXPORT = ExportFormat("universal file", encode_uff_hits, encode_uff_frf, "12 digits")
EXPORT_FORMATS = {
    ".uff": _UFF_EXPORT,
    ".unv": _UFF_EXPORT,
    ".csv": ExportFormat("text table", encode_table_hits, encode_table_frf, "17 digits"),
    ".mat": ExportFormat("MATLAB file", encode_mat_hits, encode_mat_frf, "double precision"),
    ".json": ExportFormat("SDyPy SEP005 time series", encode_sep005_hits, None, "17 digits"),
}
"""By the extension of the file that is written."""


@dataclass(frozen=True)
class Conversion:
    """What was written."""

    path: Path
    """Path of the new file."""
    title: str
    """Name of its format, for people."""
    content: str
    """FRF or hits, for people."""
    precision: str
    """Precision of its numbers, for people."""
    recording: Recording
    """Recording that it was made from."""


def convert(path: Path | str, out: Path | str, description: Description, *, hits: bool = False) -> Conversion:
    """Write the FRF of a recorded file, or its hits, in the format that the extension of `out` names.

    hits: the signals over time; a format without FRFs has them anyway. DataError for a file that does not say enough or
    does not hold what is asked for; ValueError for an extension that no format has.
    """
    path, out = Path(path), Path(out)
    writer = EXPORT_FORMATS.get(out.suffix.lower())
    if writer is None:
        raise ValueError(f"{out}: files that end with {', '.join(EXPORT_FORMATS)} are written; give one of them")
    if out.exists() and path.exists() and out.samefile(path):
        raise ValueError(f"{out}: this is the file that is read; name another")
    recording = inspect_file(path, description).require_valid()
    labels = ExportLabels(
        description.date.astimezone() if description.date else recording.created,
        description.direction or recording.direction,
        description.tool or recording.tool,
        path.name,
        format_window(recording.window),
    )
    if writer.encode_frf is not None and not hits:
        frf = recording.frf or read_frf(path, description)
        content, amount = writer.encode_frf(frf, labels), f"FRF of {frf.frequency.size} lines"
    elif recording.hits:
        content, amount = writer.encode_hits(recording.hits, labels), f"{len(recording.hits)} hit(s)"
    else:
        raise DataError(
            f"{path}: holds an FRF, not the hits it was made from; write it as {', '.join(_FRF_EXTENSIONS)}"
        )
    atomic_write(out, content)
    return Conversion(out, writer.title, amount, writer.precision, recording)


_FRF_EXTENSIONS = [extension for extension, writer in EXPORT_FORMATS.items() if writer.encode_frf]
