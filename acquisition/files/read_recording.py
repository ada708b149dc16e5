"""Detect the format of a recorded file and read its hits or its FRF."""

import functools
import logging
import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from importlib.metadata import entry_points
from pathlib import Path

from acquisition.errors import DataError, Remark, join_sentences
from acquisition.file_io import open_regular_file
from acquisition.files.contents.contents import Contents, Description, Fact, Format, append_force_signals
from acquisition.files.contents.join_recordings import join_recordings
from acquisition.files.contents.recording import Recording, resolve_recording
from acquisition.files.readers.read_arrays import ARRAY_FORMATS, MAT_FORMAT
from acquisition.files.readers.read_audio import AUDIO_FORMAT
from acquisition.files.readers.read_labview import LABVIEW_FORMATS
from acquisition.files.readers.read_text_tables import TEXT_FORMATS
from acquisition.files.readers.read_uff import UFF_FORMAT
from acquisition.files.tap_file import TAP_FORMAT
from acquisition.frf import Frf, FrfPoints
from acquisition.hit import Hit
from acquisition.hit_quality.evaluate_hit import average_good_hits
from acquisition.plugin import PLUGIN_ERRORS, format_exception_line, get_package_name, load_plugin, make_unusable_remark

FORMATS_ENTRY_POINT_GROUP = "lobewatch.formats"
"""Entry points that each name one Format."""
BUILT_IN_FORMATS = (TAP_FORMAT, UFF_FORMAT, MAT_FORMAT, *LABVIEW_FORMATS, AUDIO_FORMAT, *ARRAY_FORMATS, *TEXT_FORMATS)
"""Formats of this package; the text table is last because it takes any text."""
FORMAT_HEAD_SIZE = 4096
"""Number of bytes at the start of a file by which formats recognize it."""
EMPTY_DESCRIPTION = Description()
"""Description that states nothing."""
DECIMAL_SIGNS = {"": "", "comma": ",", "point": "."}
"""Decimal signs of a text by their names."""
_log = logging.getLogger(__name__)


def list_formats() -> tuple[Format, ...]:
    """List all formats in the order of their detection.

    Returns
    -------
    tuple of Format
        Formats of other packages first, because they know their own files, then those of this package.
    """
    return (*_load_plugin_formats()[0], *BUILT_IN_FORMATS)


def inspect_file(path: Path | str, description: Description = EMPTY_DESCRIPTION) -> Recording:
    """Inspect a recorded file of any known format.

    Parameters
    ----------
    path
        Recorded file.
    description
        Facts that the file does not state.

    Returns
    -------
    Recording
        Hits or FRF, or the `problems` that prevent it.

    Raises
    ------
    DataError
        For a file that is damaged or of no known format.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> line = np.arange(400.0, 500.0)
    >>> with TemporaryDirectory() as folder:
    ...     new_table = np.column_stack([line, 0 * line, 0 * line - 1e-6])
    ...     np.savetxt(f"{folder}/frf.csv", new_table, delimiter=",", header="frequency [Hz],real,imag", comments="")
    ...     unclear = inspect_file(f"{folder}/frf.csv")
    ...     clear = inspect_file(f"{folder}/frf.csv", Description(unit="m/N"))
    >>> print(unclear.problems)
    missing unit of real (give Description.unit, for example m/N, um/N or g/N)
    >>> clear.problems, clear.frf.frequency.size
    ('', 100)
    """
    if description.hit_files:
        if description.force is not None:
            cure = "Several files of one tap test need force and response in each of them."
            raise DataError(f"Omit Description.force {description.force}. {cure}")
        alone = replace(description, hit_files=(), one_test=True)
        return join_recordings([_try_inspect(file, alone) for file in (Path(path), *description.hit_files)])
    path = Path(path)
    file_format = detect_format(path)
    held = read_contents(file_format, path, description)
    if isinstance(held, Contents):
        if description.force is not None:
            force = _read_force_contents(description.force, description)
            held = append_force_signals(held, force, description.force)
        with _convert_errors(file_format, path):
            return resolve_recording(path, file_format.title, held, description)
    about = file_format.read_circumstances(path)
    hits, frf = ((), held) if isinstance(held, Frf) else (tuple(held), None)
    options = ", ".join(description.list_signal_options())
    problems = f"a {file_format.title} states its own signals and units. Omit {options}." if options else ""
    names = ("created", "tool", "direction", "operator", "device") if about else ()
    labels = {name: getattr(about, name) for name in names}
    conditions = about.conditions if about and about.machine else None
    facts = tuple(_list_facts(hits, frf))
    units = ("N", "m/s^2")[0 if hits and hits[0].has_force else 1 :]
    return Recording(path, file_format.title, hits, frf, facts, problems, **labels, conditions=conditions, units=units)


def _try_inspect(path: Path, description: Description) -> Recording:
    """Inspect one of several files; a damaged one is a recording with this problem."""
    try:
        return inspect_file(path, description)
    except DataError as error:
        return Recording(path, "damaged file", problems=str(error).removeprefix(f"{path}: "))


def read_recording(path: Path | str, description: Description = EMPTY_DESCRIPTION) -> list[Hit] | Frf:
    """Read the hits of a recorded file with time histories, or the FRF of one with an FRF.

    Parameters
    ----------
    path
        Recorded file of any known format.
    description
        Facts that the file does not state.

    Returns
    -------
    list of Hit or Frf
        Contents in SI units.

    Raises
    ------
    DataError
        If the file holds neither, or does not state enough.
    """
    recording = inspect_file(path, description).require_valid()
    return list(recording.hits) if recording.frf is None else recording.frf


def read_hits(path: Path | str, description: Description = EMPTY_DESCRIPTION) -> list[Hit]:
    """Read the hits of a recorded file, bad ones too (see `check_hit`).

    Parameters
    ----------
    path
        Recorded file of any known format.
    description
        Facts that the file does not state.

    Returns
    -------
    list of Hit
        Hits in the order of the file.

    Raises
    ------
    DataError
        If the file has no hits, or does not state enough.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> time = np.arange(-100, 4000) / 10240.0
    >>> force = 200 * np.where((time >= 0) & (time <= 1e-3), np.sin(np.pi * time / 1e-3) ** 4, 0.0)  # N
    >>> structure = Structure(np.array([500.0]), np.array([0.02]), np.array([2e7]))
    >>> with TemporaryDirectory() as folder:
    ...     new_table = np.column_stack([time, force, 200 * structure.response(time, 1e-3) / STANDARD_GRAVITY])
    ...     names = "time [s],force [N],response [g]"
    ...     np.savetxt(f"{folder}/hit.csv", new_table, delimiter=",", header=names, comments="")
    ...     (hit,) = read_hits(f"{folder}/hit.csv")
    >>> f"{hit.sample_rate:.0f} Hz, {hit.force.max():.0f} N, {abs(hit.acceleration).max():.1f} m/s^2"
    '10240 Hz, 199 N, 102.1 m/s^2'
    """
    recording = read_recording(path, description)
    if isinstance(recording, Frf):
        raise DataError(f"{path}: the file has an FRF but no hits. Export the hits as signals over time.")
    return recording


def read_frf(path: Path | str, description: Description = EMPTY_DESCRIPTION) -> Frf:
    """Read the FRF of a recorded file, or estimate it (H1) from its good hits.

    Parameters
    ----------
    path
        Recorded file of any known format.
    description
        Facts that the file does not state.

    Returns
    -------
    Frf
        Receptance (m/N).

    Raises
    ------
    DataError
        If the file has neither an FRF nor a good hit, or does not state enough.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> line = np.arange(400.0, 500.0)
    >>> with TemporaryDirectory() as folder:
    ...     new_table = np.column_stack([line, 0 * line, 0 * line - 1.0])
    ...     names = "frequency [Hz],real [um/N],imag [um/N]"
    ...     np.savetxt(f"{folder}/frf.csv", new_table, delimiter=",", header=names, comments="")
    ...     frf = read_frf(f"{folder}/frf.csv")
    >>> complex(frf.receptance[0])  # m/N
    -1e-06j
    """
    path = Path(path)
    read_stored = None if description.hit_files else detect_format(path).read_frf
    if read_stored is not None:
        return read_stored(path)
    recording = read_recording(path, description)
    if isinstance(recording, Frf):
        return recording
    try:
        frf = average_good_hits(recording)[0]
    except DataError as error:
        raise DataError(f"{path}: {error}") from error
    if frf is None:
        raise DataError(f"{path}: no FRF, because no force was measured. Tap with an instrumented hammer.")
    return frf


def list_frf_points(path: Path) -> list[FrfPoints | None]:
    """List the points of each FRF in a file, in the order of `Description.response`; None for an FRF without points.

    Parameters
    ----------
    path
        Recorded file of any known format.

    Returns
    -------
    list of FrfPoints or None
        Points and directions of response and hit; empty for a file without FRFs.

    Raises
    ------
    DataError
        For a file that is damaged or of no known format.
    """
    held = read_contents(detect_format(path), path, EMPTY_DESCRIPTION)
    return [signal.points for signal in held.signals if signal.role == "frf"] if isinstance(held, Contents) else []


def detect_format(path: Path) -> Format:
    """Detect the format of a file by its content; raise DataError for an empty file or an unknown format."""
    with open_regular_file(path, math.inf) as file:
        head = file.read(FORMAT_HEAD_SIZE)
    if not head:
        raise DataError(f"{path}: the file is empty")
    for file_format in list_formats():
        try:
            if file_format.matches(head, path):
                return file_format
        except PLUGIN_ERRORS as error:  # the code of other packages may raise anything
            reason = format_exception_line(error)
            _log.warning("%r: format %r failed to check the file (%s)", str(path), file_format.name, reason)
    titles = ", ".join(f"{file_format.title} ({', '.join(file_format.extensions)})" for file_format in list_formats())
    cure = f"Export the recording as {titles}"
    raise DataError(join_sentences(f"{path}: unknown file format", cure, *_list_broken_formats()))


def read_contents(file_format: Format, path: Path, description: Description) -> Contents | list[Hit] | Frf:
    """Read a file of this format, with the skipped lines and the decimal sign of the description for a text."""
    read_from, skip, decimal = file_format.read_from, description.skip, description.decimal
    if not skip and not decimal:
        with _convert_errors(file_format, path):
            return file_format.read(path)
    option = f"{path}: Description.skip {skip}" if skip else f"{path}: Description.decimal {decimal}"
    if read_from is None:
        raise DataError(f"{option}: a {file_format.title} has no lines of text. Omit this option.")
    if decimal not in DECIMAL_SIGNS:
        raise DataError(f"{option} is not comma or point")
    with _convert_errors(file_format, path):
        return read_from(path, skip or 0, DECIMAL_SIGNS[decimal])


def _read_force_contents(path: Path, description: Description) -> Contents:
    file_format = detect_format(path)
    held = read_contents(file_format, path, description if file_format.read_from else EMPTY_DESCRIPTION)
    if not isinstance(held, Contents):
        raise DataError(f"Omit Description.force {path}: a {file_format.title} already has force and response")
    return held


@contextmanager
def _convert_errors(file_format: Format, path: Path) -> Iterator[None]:
    """Convert any failure of some work on a file to a DataError."""
    try:
        yield
    except DataError as error:
        raise DataError(join_sentences(str(error), *_list_broken_formats())) from error
    except OSError:
        raise
    except Exception as error:
        fault = f"unreadable as {file_format.title} ({type(error).__name__}: {error})"
        raise DataError(f"{path}: {fault}. Export the recording in another format.") from error


def _list_broken_formats() -> list[str]:
    """List the faults in formats of other packages, to append to the error of a file."""
    return [f"Note on {remark}" for remark in _load_plugin_formats()[1]]


@functools.cache
def _load_plugin_formats() -> tuple[tuple[Format, ...], tuple[Remark, ...]]:
    """Return the formats of other packages, and a remark on each that cannot be used."""
    formats: dict[str, Format] = {}
    remarks: list[Remark] = []
    taken = {built_in.name for built_in in BUILT_IN_FORMATS}
    for point in sorted(entry_points(group=FORMATS_ENTRY_POINT_GROUP), key=lambda point: point.name):
        plugin = load_plugin(point, Format)
        if not isinstance(plugin, Format):
            remarks.append(plugin)
        elif plugin.name in taken | formats.keys():
            text = f"{get_package_name(point)} and another package both provide this format"
            remarks.append(make_unusable_remark(Format, point.name, text))
        else:
            formats[plugin.name] = plugin
    return tuple(formats.values()), tuple(remarks)


def _list_facts(hits: Sequence[Hit], frf: Frf | None) -> list[Fact]:
    if frf is not None:
        span = f"{frf.frequency.size}, {frf.frequency[0]:.4g} to {frf.frequency[-1]:.6g} Hz"
        return [Fact("lines", span, "file"), Fact("unit", f"m/N, from {frf.measured_as}", "file")]
    unit, force = Fact("unit", "m/s^2 (acceleration)", "file"), Fact("force", "N", "file")
    return [Fact("sample rate", f"{hits[0].sample_rate:.8g} Hz", "file"), *([force] if hits[0].has_force else []), unit]
