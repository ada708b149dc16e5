"""Convert a recorded file to a format of other programs."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from acquisition.errors import DataError
from acquisition.file_io import atomic_write
from acquisition.files import writers
from acquisition.files.contents.contents import format_window
from acquisition.files.contents.description import Description
from acquisition.files.contents.recording import Recording
from acquisition.files.read_recording import inspect_file, read_frf
from acquisition.frf import Frf
from acquisition.hit import Hit


@dataclass(frozen=True)
class ExportFormat:
    """Format that can be written."""

    title: str
    """Name of the format, for people."""
    encode_hits: Callable[[Sequence[Hit], writers.ExportLabels], bytes]
    """Function that writes signals over time."""
    encode_frf: Callable[[Frf, writers.ExportLabels], bytes] | None
    """Function that writes an FRF; None where the format has none."""
    precision: str
    """Precision of its numbers, for people."""


_UFF_EXPORT = ExportFormat("universal file", writers.encode_uff_hits, writers.encode_uff_frf, "12 digits")
EXPORT_FORMATS = {
    ".uff": _UFF_EXPORT,
    ".unv": _UFF_EXPORT,
    ".csv": ExportFormat("text table", writers.encode_table_hits, writers.encode_table_frf, "17 digits"),
    ".mat": ExportFormat("MATLAB file", writers.encode_mat_hits, writers.encode_mat_frf, "double precision"),
    ".json": ExportFormat("SDyPy SEP005 time series", writers.encode_sep005_hits, None, "17 digits"),
}
"""Format by the extension of the written file."""


@dataclass(frozen=True)
class Conversion:
    """Result of a conversion."""

    path: Path
    """Path of the new file."""
    title: str
    """Name of its format, for people."""
    content: str
    """FRF or hits, for people."""
    precision: str
    """Precision of its numbers, for people."""
    recording: Recording
    """Recording that was converted."""


def convert(path: Path | str, out: Path | str, description: Description, *, hits: bool = False) -> Conversion:
    """Write the FRF of a recorded file, or its hits, in the format of the extension of `out`.

    Parameters
    ----------
    path
        Recorded file.
    out
        File to write.
    description
        What the recorded file does not state.
    hits
        Whether to write the signals over time; a format without FRFs always does.

    Returns
    -------
    Conversion
        What was written.

    Raises
    ------
    DataError
        For a file that does not state enough or does not hold what is requested.
    ValueError
        For an extension that no format has.
    """
    path, out = Path(path), Path(out)
    writer = EXPORT_FORMATS.get(out.suffix.lower())
    if writer is None:
        raise ValueError(f"{out}: files that end with {', '.join(EXPORT_FORMATS)} are written; give one of them")
    if out.exists() and path.exists() and out.samefile(path):
        raise ValueError(f"{out}: this is the file that is read; name another")
    recording = inspect_file(path, description).require_valid()
    created = description.date.astimezone() if description.date else recording.created
    direction, tool = description.direction or recording.direction, description.tool or recording.tool
    labels = writers.ExportLabels(created, direction, tool, path.name, format_window(recording.window))
    if writer.encode_frf is not None and not hits:
        frf = recording.frf or read_frf(path, description)
        content, amount = writer.encode_frf(frf, labels), f"FRF of {frf.frequency.size} lines"
    elif recording.hits:
        content, amount = writer.encode_hits(recording.hits, labels), f"{len(recording.hits)} hit(s)"
    else:
        raise DataError(f"{path}: holds an FRF, not the hits it was made from; write it as {_FRF_EXTENSIONS}")
    atomic_write(out, content)
    return Conversion(out, writer.title, amount, writer.precision, recording)


_FRF_EXTENSIONS = ", ".join(extension for extension, writer in EXPORT_FORMATS.items() if writer.encode_frf)
