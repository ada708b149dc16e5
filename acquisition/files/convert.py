"""Convert a recorded file to a text table, MATLAB file, SEP005 JSON or universal file."""

import io
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.arrays import Complexes, Floats
from acquisition.errors import DataError
from acquisition.file_io import atomic_write
from acquisition.files.contents.contents import Description, format_window
from acquisition.files.contents.recording import Recording
from acquisition.files.read_recording import inspect_file, read_frf
from acquisition.frf import FRF_UNITS, Frf
from acquisition.hit import Hit


@dataclass(frozen=True)
class ExportLabels:
    """Labels of a tap test in a file for other programs."""

    created: datetime | None = None
    """Time of recording (timezone-aware)."""
    direction: str = ""
    """Direction at the tool tip, x or y."""
    tool: str = ""
    """Name of the tool in the spindle."""
    name: str = "tap test"
    """Title, for people."""
    window: str = "none"
    """Window over the response: "exponential 0.05 s"."""

    @property
    def texts(self) -> dict[str, str]:
        """Time, direction, tool and window by the names in files."""
        recorded = self.created.isoformat() if self.created else ""
        return {"recorded": recorded, "direction": self.direction, "tool": self.tool, "window": self.window}

    @property
    def plain_tool(self) -> str:
        """Name of the tool without line ends and semicolons."""
        return " ".join(self.tool.replace(";", ",").split())


def convert_to_measured_form(frf: Frf) -> tuple[Complexes, str]:
    """Return the values of an FRF in the form that was measured, which keeps them exact, and their unit."""
    return getattr(frf, frf.measured_as), FRF_UNITS[frf.measured_as]


def encode_table_frf(frf: Frf, labels: ExportLabels) -> bytes:
    """Encode frequency, real and imaginary part, and coherence if known, with 17 digits."""
    values, unit = convert_to_measured_form(frf)
    columns = {"frequency [Hz]": frf.frequency, f"real [{unit}]": values.real, f"imag [{unit}]": values.imag}
    if frf.coherence is not None:
        columns["coherence"] = frf.coherence
    return _encode_table(columns, labels, averages=frf.n_averages)


def encode_table_hits(hits: Sequence[Hit], labels: ExportLabels) -> bytes:
    """Encode time, force and acceleration of one hit; raise DataError for several."""
    if len(hits) != 1:
        raise DataError(f"a text table cannot hold {len(hits)} hits. Write .uff, .mat or .json, or only the FRF.")
    (hit,) = hits
    time = np.arange(hit.force.size) / hit.sample_rate
    return _encode_table({"time [s]": time, "force [N]": hit.force, "acceleration [m/s^2]": hit.acceleration}, labels)


def _encode_table(columns: dict[str, Floats], labels: ExportLabels, averages: int | None = None) -> bytes:
    keys = {"written by": "lobewatch", **labels.texts, "tool": labels.plain_tool}
    keys["window"] = labels.window.replace("none", "")
    keys |= {"averages": str(averages or ""), "rows": str(next(iter(columns.values())).size)}
    lines = [f"# {key}: {value}" for key, value in keys.items() if value]
    lines.append(",".join(columns))
    lines += [",".join(map(repr, row)) for row in zip(*(column.tolist() for column in columns.values()), strict=True)]
    return ("\n".join(lines) + "\n").encode("utf-8")


def encode_mat_frf(frf: Frf, labels: ExportLabels) -> bytes:
    """Encode frequency (Hz), FRF with its unit, coherence and averages as MATLAB v5."""
    values, unit = convert_to_measured_form(frf)
    variables: dict[str, Any] = {"frequency": frf.frequency, "frf": values, "unit": unit, "averages": frf.n_averages}
    if frf.coherence is not None:
        variables["coherence"] = frf.coherence
    return _encode_mat(variables, labels)


def encode_mat_hits(hits: Sequence[Hit], labels: ExportLabels) -> bytes:
    """Encode force (N) and acceleration (m/s^2), a row per hit, and the sample rate (Hz) as MATLAB v5."""
    if len({(hit.force.size, hit.sample_rate) for hit in hits}) > 1:
        raise DataError("the hits differ in length or sample rate. Write the hits as .json.")
    rows = {name: np.stack([getattr(hit, name) for hit in hits]) for name in ("force", "acceleration")}
    return _encode_mat({**rows, "sample_rate": hits[0].sample_rate}, labels)


def _encode_mat(variables: dict[str, Any], labels: ExportLabels) -> bytes:
    import scipy.io  # it takes a while, and few files need it

    buffer = io.BytesIO()
    scipy.io.savemat(buffer, {"written_by": "lobewatch", **labels.texts, **variables}, oned_as="column")
    return buffer.getvalue()


def encode_sep005_hits(hits: Sequence[Hit], labels: ExportLabels) -> bytes:
    """Encode force (N) and acceleration (m/s^2) of each hit as SEP005 JSON, with a group per hit."""
    texts = {"start_timestamp": labels.created.isoformat()} if labels.created else {}
    texts |= {key: value for key, value in (("direction", labels.direction), ("tool", labels.tool)) if value}
    channels = []
    for number, hit in enumerate(hits, 1):
        shared = {"fs": hit.sample_rate, "group": f"hit {number}", **texts}
        for name, quantity, unit in (("force", "f", "N"), ("acceleration", "a", "m/s^2")):
            about = {"name": name, "quantity": quantity, "unit_str": unit}
            channels.append({**about, **shared, "data": getattr(hit, name).tolist()})
    return json.dumps(channels, allow_nan=False).encode("utf-8")


_UffAxis = tuple[int, str, str]
_UFF_NO_QUANTITY = (0, "NONE", "NONE")
_UFF_FORCE = (13, "Force", "N")
_UFF_ORDINATES = {
    "receptance": (8, "Displacement", "m"),
    "mobility": (11, "Velocity", "m/s"),
    "accelerance": (12, "Acceleration", "m/s^2"),
}
MAX_STEP_DIFFERENCE = 1e-9
"""Largest relative difference of equal frequency steps."""


def encode_uff_frf(frf: Frf, labels: ExportLabels) -> bytes:
    """Encode the FRF as function type 4 and its coherence as type 6.

    Values have 12 digits, the abscissa 6 as the format demands. All digits of its step are in a line of identification,
    from which lobewatch reads it. Source: SDRC Universal File Formats 58, 151, 164.
    """
    axis, averages = _Abscissa(frf.frequency, (18, "Frequency", "Hz")), f"averages={frf.n_averages}"
    axes = (_UFF_ORDINATES[frf.measured_as], _UFF_FORCE)
    sets = [_format_data_set_58(4, axis, convert_to_measured_form(frf)[0], axes, labels, averages)]
    if frf.coherence is not None:
        sets.append(_format_data_set_58(6, axis, frf.coherence, (), labels, averages))
    return _encode_uff(sets, labels)


def encode_uff_hits(hits: Sequence[Hit], labels: ExportLabels) -> bytes:
    """Encode force and acceleration of each hit as function type 1."""
    sets = []
    for number, hit in enumerate(hits, 1):
        axis = _Abscissa(np.arange(hit.force.size) / hit.sample_rate, (17, "Time", "s"), 1 / hit.sample_rate)
        for values, ordinate in ((hit.force, _UFF_FORCE), (hit.acceleration, _UFF_ORDINATES["accelerance"])):
            sets.append(_format_data_set_58(1, axis, values, (ordinate,), labels, f"hit={number}"))
    return _encode_uff(sets, labels)


class _Abscissa:
    """Abscissa with its step."""

    def __init__(self, values: Floats, what: tuple[int, str, str], step: float | None = None) -> None:
        self.values, self.what = values, what
        self.step = step or float(values[-1] - values[0]) / (values.size - 1)
        even = values[0] + self.step * np.arange(values.size)
        self.is_even = bool(np.max(np.abs(values - even)) <= MAX_STEP_DIFFERENCE * abs(self.step))


def _format_data_set_58(
    kind: int, axis: _Abscissa, values: Floats | Complexes, axes: Sequence[_UffAxis], labels: ExportLabels, extra: str
) -> list[str]:
    node = {"x": 1, "y": 2, "z": 3}.get(labels.direction, 0)
    exact = f"step={axis.step!r};start={float(axis.values[0])!r};" if axis.is_even else ""
    recorded = f"window={labels.window}" + (f";recorded={labels.created.isoformat()}" if labels.created else "")
    stamp = f"{labels.created:%d-%b-%y %H:%M:%S}" if labels.created else "NONE"
    lines = [f"{58:6d}", labels.name, exact + extra, stamp, recorded, f"tool={labels.plain_tool}"]
    lines[1:6] = [_check_identification_line(text) for text in lines[1:6]]
    point = f" {'NONE':10s}{1:10d}{node:4d}"
    lines.append(f"{kind:5d}{0:10d}{0:5d}{0:10d}{point}{point}")
    is_complex, n = np.iscomplexobj(values), values.size
    start, step = (axis.values[0], axis.step) if axis.is_even else (0.0, 0.0)
    spacing = int(axis.is_even)
    lines.append(f"{6 if is_complex else 4:10d}{n:10d}{spacing:10d}{start:13.5E}{step:13.5E}{0.0:13.5E}")
    for t, name, unit in [axis.what, *axes, *3 * [_UFF_NO_QUANTITY]][:4]:
        lines.append(f"{t:10d}{0:5d}{0:5d}{0:5d} {name:20s} {unit:20s}")
    return [*lines, *_format_values(axis, values)]


def _check_identification_line(text: str) -> str:
    """Return a line of identification; raise DataError if it has more than 80 characters."""
    if len(text.encode("utf-8")) > 80:
        raise DataError(f"{text!r} is longer than 80 characters, the limit of a line in a universal file")
    return text or "NONE"


def _format_values(axis: _Abscissa, values: Floats | Complexes) -> Iterator[str]:
    """Yield lines of values.

    Even axes have four numbers of 20 characters a line, uneven axes the abscissa (13) before each value.
    """
    parts = [values.real, values.imag] if np.iscomplexobj(values) else [values]
    numbers = np.stack(parts, axis=1)
    if axis.is_even:
        flat = numbers.ravel()
        for first in range(0, flat.size, 4):
            yield "".join(f"{value:20.11E}" for value in flat[first : first + 4])
        return
    for x, row in zip(axis.values, numbers, strict=True):
        yield f"{x:13.5E}" + "".join(f"{value:20.11E}" for value in row)


def _encode_uff(sets: Sequence[list[str]], labels: ExportLabels) -> bytes:
    written = labels.created or datetime.now(UTC)
    day = f"{written:%d-%b-%y}{written:%H:%M:%S}".ljust(20)
    header = [f"{151:6d}", _check_identification_line(labels.name), "NONE", "lobewatch", day, day, "lobewatch", day]
    units = [f"{164:6d}", f"{1:10d}{'SI: Meter (newton)':20s}{2:10d}"]
    units += [f"{1.0:25.17E}{1.0:25.17E}{1.0:25.17E}", f"{273.15:25.17E}"]
    mark = "    -1"
    lines = [line for data_set in (header, units, *sets) for line in (mark, *data_set, mark)]
    return ("\n".join(lines) + "\n").encode("utf-8")


@dataclass(frozen=True)
class ExportFormat:
    """Format that can be written."""

    title: str
    """Name of the format, for people."""
    encode_hits: Callable[[Sequence[Hit], ExportLabels], bytes]
    """Function that writes signals over time."""
    encode_frf: Callable[[Frf, ExportLabels], bytes] | None
    """Function that writes an FRF; None if the format has none."""
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
        Facts that the recorded file does not state.
    hits
        Whether to write the signals over time; a format without FRFs always does.

    Returns
    -------
    Conversion
        Content of the new file.

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
        raise ValueError(f"{out}: extension {out.suffix!r} is not one of {', '.join(EXPORT_FORMATS)}")
    if out.exists() and path.exists() and out.samefile(path):
        raise ValueError(f"{out}: this is also the input file. Give another output file.")
    recording = inspect_file(path, description).require_valid()
    created = description.date.astimezone() if description.date else recording.created
    direction, tool = description.direction or recording.direction, description.tool or recording.tool
    labels = ExportLabels(created, direction, tool, path.name, format_window(recording.window))
    if writer.encode_frf is not None and not hits:
        frf = recording.frf or read_frf(path, description)
        content, amount = writer.encode_frf(frf, labels), f"FRF of {frf.frequency.size} lines"
    elif recording.hits:
        content, amount = writer.encode_hits(recording.hits, labels), f"{len(recording.hits)} hit(s)"
    else:
        raise DataError(f"{path}: the file has an FRF but no hits. Write the FRF as {_FRF_EXTENSIONS}.")
    atomic_write(out, content)
    return Conversion(out, writer.title, amount, writer.precision, recording)


_FRF_EXTENSIONS = ", ".join(extension for extension, writer in EXPORT_FORMATS.items() if writer.encode_frf)
