"""Read arrays from MATLAB, NumPy, HDF5 and SEP005 JSON files, with their roles by known names."""

import json
import re
import struct
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from acquisition.errors import DataError
from acquisition.files.contents.column_headings import infer_role
from acquisition.files.contents.contents import Contents, Format, Signal, list_array_signals, list_distinct_names
from acquisition.files.hdf5_file import HDF5_SIGNATURE, check_unpacked_total
from acquisition.files.readers.mat_layouts import find_window, recognize_layout
from acquisition.files.readers.mat_variables import MAT_V73_SIGNATURE, read_mat_variables

_MAT_V5_SIGNATURE = b"MATLAB 5.0 MAT-file"
_MAT_V4_KINDS = range(53)
_MAT_V4_NAME = re.compile(rb"[A-Za-z]\w*\0")


def read_mat(path: Path) -> Contents:
    """Read the arrays of a MATLAB file; raise DataError if it is damaged or unpacks out of proportion."""
    variables = read_mat_variables(path)
    return recognize_layout(variables) or Contents(tuple(list_array_signals(variables)), window=find_window(variables))


def _is_mat(head: bytes, _path: Path) -> bool:
    """Return whether a file begins with a signature, or with the header of a matrix in either byte order and its name.

    Source: MAT-File Format (The MathWorks), level 4: type, rows, columns, whether complex, length of the name.
    """
    if head.startswith((_MAT_V5_SIGNATURE, MAT_V73_SIGNATURE)):
        return True
    for order, least in (("<", 0), (">", 1000)):
        kind, rows, columns, is_complex, length = struct.unpack_from(f"{order}5i", head.ljust(20))
        sizes = rows >= 0 and columns >= 0 and is_complex in (0, 1)
        if kind - least in _MAT_V4_KINDS and sizes and _MAT_V4_NAME.fullmatch(head[20 : 20 + max(length, 0)]):
            return True
    return False


MAT_FORMAT = Format("mat", "MATLAB file", (".mat", ".vna"), _is_mat, read_mat)


NPY_SIGNATURE, ZIP_SIGNATURE = b"\x93NUMPY", b"PK\x03\x04"
"""Signatures at the beginning of these files."""


def read_numpy(path: Path) -> Contents:
    """Read the arrays of a .npy or .npz file; raise DataError for other objects, damage, or too large a size."""
    try:
        with path.open("rb") as file:
            return _read_numpy_file(file, path)
    except (ValueError, EOFError, OSError, zipfile.BadZipFile) as error:
        fault = f"unreadable NumPy file ({error})"
        raise DataError(f"{path}: {fault}. Save arrays of numbers, without Python objects.") from error


def _read_numpy_file(file: BinaryIO, path: Path) -> Contents:
    if zipfile.is_zipfile(file):
        with zipfile.ZipFile(file) as archive:
            check_unpacked_total(sum(member.file_size for member in archive.infolist()), path.stat().st_size, path)
    file.seek(0)
    loaded = np.load(file, allow_pickle=False)
    if isinstance(loaded, np.ndarray):
        fields = loaded.dtype.names
        return _make_array_contents({"array": loaded} if fields is None else {name: loaded[name] for name in fields})
    with loaded:
        return _make_array_contents({name: loaded[name][()] for name in loaded.files})


def read_hdf5(path: Path) -> Contents:
    """Read the data sets of an HDF5 file by their paths; raise DataError for damage or unpacking out of proportion."""
    contents = _make_array_contents(read_mat_variables(path))
    in_file = {id(one.array): one.array.T for one in contents.signals if one.array is not None}  # not as in MATLAB
    signals = (replace(one, array=in_file.get(id(one.array))) for one in contents.signals)
    return replace(contents, signals=tuple(signals))


def _make_array_contents(variables: Mapping[str, Any]) -> Contents:
    return recognize_layout(variables) or Contents(tuple(list_array_signals(variables, glue="/")))


def _is_numpy(head: bytes, path: Path) -> bool:
    return head.startswith(NPY_SIGNATURE) or (head.startswith(ZIP_SIGNATURE) and path.suffix.lower() == ".npz")


def _is_hdf5(head: bytes, _path: Path) -> bool:
    return head.startswith(HDF5_SIGNATURE)


_SEP005_KEYS = ("data", "name", "unit_str")


def read_sep005(path: Path) -> Contents:
    """Read the channels of SEP005 JSON; raise DataError if it is damaged or no list of time series."""
    try:
        channels = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise DataError(f"{path}: damaged or truncated JSON file ({error}). Export the file again.") from error
    return parse_sep005(str(path), channels)


def parse_sep005(place: str, channels: Sequence[Mapping[str, Any]]) -> Contents:
    """Return the contents of SEP005 dictionaries; place: for errors. Channels of one group were recorded together."""
    signals, groups = list[Signal](), dict[str, int]()
    for number, channel in enumerate(channels, 1):
        where = f"{place}: channel {number}"
        missing = [key for key in _SEP005_KEYS if key not in channel]
        missing += [] if {"fs", "time"} & channel.keys() else ["fs"]
        if missing:
            raise DataError(f"{where} lacks {', '.join(missing)}, which SEP005 requires. Add these keys.")
        record = groups.setdefault(str(channel.get("group", "")), len(groups))
        try:
            values = np.asarray(channel["data"], dtype=np.float64).ravel()
            rate = None if channel.get("fs") is None else float(channel["fs"])
            time = None if rate is not None else np.asarray(channel["time"], dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise DataError(f"{where}: {error}") from error
        if rate is not None and not rate > 0:
            raise DataError(f"{where}: sample rate fs={rate} Hz is not above 0")
        name, unit = str(channel["name"]), str(channel["unit_str"] or "")
        signals.append(Signal(name, values, infer_role(name, unit), unit, rate=rate, record=record))
        signals += [] if time is None else [Signal("time", time, "time", "s", record=record)]
    first = channels[0] if channels else {}
    direction, tool = (str(first.get(key, "")) for key in ("direction", "tool"))
    created, names = _parse_timestamp(first.get("start_timestamp")), list_distinct_names(groups)
    return Contents(tuple(signals), created=created, direction=direction, tool=tool, groups=names)


def _parse_timestamp(text: object) -> datetime | None:
    try:
        return datetime.fromisoformat(str(text)).astimezone()
    except (ValueError, OverflowError, OSError):
        return None


def _is_sep005(head: bytes, _path: Path) -> bool:
    return head.lstrip().startswith(b"[") and b"{" in head[:200] and b'"' in head[:200]


ARRAY_FORMATS = (
    Format("sep005", "SDyPy SEP005 time series", (".json",), _is_sep005, read_sep005),
    Format("numpy", "NumPy file", (".npy", ".npz"), _is_numpy, read_numpy),
    Format("hdf5", "HDF5 file of another program", (".hdf5", ".h5", ".hdf"), _is_hdf5, read_hdf5),
)
