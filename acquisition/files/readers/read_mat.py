"""MATLAB files, v5 and v7.3: all arrays of numbers in them by name, and what those of known layouts are."""

from __future__ import annotations

import math
import subprocess
import sys
import warnings
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from acquisition.errors import DataError
from acquisition.files.contents.contents import Contents, Signal
from acquisition.files.readers.format import Format
from acquisition.files.readers.mat_layouts import recognised
from acquisition.files.readers.mat_window import window_of
from acquisition.files.readers.unpacked import HARMLESS, RATIO, check_unpacked

_V5 = b"MATLAB 5.0 MAT-file"
_V73 = b"MATLAB 7.3 MAT-file"
PATIENCE = 60.0
"""Time that reading one file may take (s)."""
MOST_COLUMNS = 64
"""Columns of a matrix that are told one by one."""


def read_mat(path: Path) -> Contents:
    """Its arrays; DataError where it is damaged or unpacks out of proportion."""
    _refuse_crash(path)
    variables = _variables(path)
    contents = recognised(variables)
    if contents is not None:
        return contents
    return Contents(tuple(_columns(variables)), window=window_of(variables))


def _variables(path: Path) -> dict[str, Any]:
    with path.open("rb") as file:
        is_hdf5 = file.read(len(_V73)) == _V73
    return _of_v73(path) if is_hdf5 else _of_v5(path)


def _refuse_crash(path: Path) -> None:
    """DataError where a program that does nothing but read the file ends in a crash, or not at all.

    Neither format has a checksum, and scipy and HDF5 crash on some damaged files.
    """
    try:
        command = [sys.executable, "-m", __name__, str(path)]
        subprocess.run(command, capture_output=True, timeout=PATIENCE, check=True)
    except subprocess.SubprocessError as error:
        raise DataError(f"{path}: damaged: its reader crashes or hangs on it; export it anew") from error


def _of_v5(path: Path) -> dict[str, Any]:
    """Variables by name; structs as dictionaries."""
    import scipy.io  # it takes a while, and few files need it

    size = path.stat().st_size
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            unpacked = sum(16 * math.prod(shape) for _, shape, _ in scipy.io.whosmat(path))
            if unpacked > max(HARMLESS, RATIO * size):
                raise DataError(f"{path}: {size / 1e6:.3g} MB that unpack to {unpacked / 1e6:.4g} MB; no tap test does")
            variables = scipy.io.loadmat(path, simplify_cells=True)
    except DataError:
        raise
    except Exception as error:
        raise DataError(f"{path}: damaged or cut short ({type(error).__name__}: {error}); export it anew") from error
    return {name: value for name, value in variables.items() if not name.startswith("__")}


def _of_v73(path: Path) -> dict[str, Any]:
    """The same of HDF5: arrays transposed, complex numbers as pairs, text as 16-bit codes."""
    try:
        with h5py.File(path, "r") as file:
            check_unpacked(file, path.stat().st_size, path)
            return {name: _plain(node) for name, node in file.items() if name != "#refs#"}
    except DataError:
        raise
    except Exception as error:
        raise DataError(f"{path}: damaged or cut short ({type(error).__name__}: {error}); export it anew") from error


def _plain(node: Any) -> Any:
    if isinstance(node, h5py.Group):
        return {name: _plain(child) for name, child in node.items()}
    values = node[()]
    kind = node.attrs.get("MATLAB_class", b"")
    if node.attrs.get("MATLAB_empty", 0):
        return np.empty(0)
    if values.dtype.names == ("real", "imag"):
        values = values["real"] + 1j * values["imag"]
    if values.dtype.kind == "O":
        cells = [_plain(node.file[reference]) for reference in values.ravel()]
        return cells[0] if len(cells) == 1 else cells
    if kind == b"char":
        return "".join(map(chr, values.T.ravel()))
    squeezed = np.squeeze(values.T)
    return squeezed[()] if squeezed.ndim == 0 else squeezed


def _columns(variables: Mapping[str, Any], prefix: str = "") -> Iterator[Signal]:
    """Every row of two or more numbers; those of a matrix as name:1, name:2, ..."""
    for name, value in variables.items():
        if isinstance(value, Mapping):
            yield from _columns(value, f"{prefix}{name}.")
        elif isinstance(value, np.ndarray) and value.dtype.kind in "fiuc":
            yield from _of_array(f"{prefix}{name}", value)


def _of_array(name: str, value: np.ndarray[Any, Any]) -> Iterator[Signal]:
    if value.ndim == 1 and value.size > 1:
        yield Signal(name, value)
    elif value.ndim == 2:
        tall = value if value.shape[0] >= value.shape[1] else value.T
        for i, column in enumerate(tall.T[:MOST_COLUMNS], 1):
            yield Signal(f"{name}:{i}", column)


def _is_mat(head: bytes, _path: Path) -> bool:
    return head.startswith((_V5, _V73))


MAT = Format("mat", "MATLAB file", (".mat",), _is_mat, read_mat)


if __name__ == "__main__":
    with suppress(Exception):  # told by the program that asks
        _variables(Path(sys.argv[1]))
