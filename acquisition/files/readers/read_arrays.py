"""Arrays as Python users keep them: .npy, .npz, HDF5 of any paths. Names that are known say what they are."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from acquisition.errors import DataError
from acquisition.files.contents.contents import Contents
from acquisition.files.readers.array_columns import columns_of
from acquisition.files.readers.format import Format
from acquisition.files.readers.hdf5_in import HDF5
from acquisition.files.readers.mat_layouts import recognised
from acquisition.files.readers.mat_variables import mat_variables
from acquisition.files.readers.unpacked import HARMLESS, RATIO

NPY, ZIP = b"\x93NUMPY", b"PK\x03\x04"
"""How these files begin."""


def read_numpy(path: Path) -> Contents:
    """The arrays of a .npy or .npz file; DataError where they are no numbers, damaged, or unpack out of proportion."""
    try:
        with path.open("rb") as file:
            return _read(file, path)
    except (ValueError, EOFError, OSError, zipfile.BadZipFile) as error:
        raise DataError(f"{path}: cannot be read ({error}); save its numbers alone, without Python objects") from error


def _read(file: BinaryIO, path: Path) -> Contents:
    if zipfile.is_zipfile(file):
        _check_unpacked(file, path)
    file.seek(0)
    loaded = np.load(file, allow_pickle=False)
    if isinstance(loaded, np.ndarray):
        return _contents(_fields(loaded))
    with loaded:
        return _contents({name: loaded[name][()] for name in loaded.files})


def _fields(array: np.ndarray[Any, Any]) -> dict[str, Any]:
    """An array by its name, or the fields of one that has fields."""
    names = array.dtype.names
    return {"array": array} if names is None else {name: array[name] for name in names}


def _check_unpacked(file: BinaryIO, path: Path) -> None:
    packed = path.stat().st_size
    with zipfile.ZipFile(file) as archive:
        unpacked = sum(member.file_size for member in archive.infolist())
    if unpacked > max(HARMLESS, RATIO * packed):
        raise DataError(f"{path}: {packed / 1e6:.3g} MB that unpack to {unpacked / 1e6:.4g} MB; no tap test does")


def read_hdf5(path: Path) -> Contents:
    """The data sets of an HDF5 file by their paths; DataError where it is damaged or unpacks out of proportion."""
    return _contents(mat_variables(path))


def _contents(variables: Mapping[str, Any]) -> Contents:
    return recognised(variables) or Contents(tuple(columns_of(variables, glue="/")))


def _is_numpy(head: bytes, path: Path) -> bool:
    return head.startswith(NPY) or (head.startswith(ZIP) and path.suffix.lower() == ".npz")


def _is_hdf5(head: bytes, _path: Path) -> bool:
    return head.startswith(HDF5)


NUMPY = Format("numpy", "NumPy file", (".npy", ".npz"), _is_numpy, read_numpy)
FOREIGN_HDF5 = Format("hdf5", "HDF5 file of another program", (".hdf5", ".h5", ".hdf"), _is_hdf5, read_hdf5)
