"""MATLAB files, v4, v5 and v7.3: all arrays of numbers in them by name, and what those of known layouts are."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.files.contents.contents import Contents, Signal
from acquisition.files.readers.format import Format
from acquisition.files.readers.mat_layouts import recognised
from acquisition.files.readers.mat_variables import V73, mat_variables
from acquisition.files.readers.mat_window import window_of

_V5 = b"MATLAB 5.0 MAT-file"
_V4_KINDS = range(53)
_V4_NAME = re.compile(rb"[A-Za-z]\w*\0")
MOST_COLUMNS = 64
"""Columns of a matrix that are told one by one."""


def read_mat(path: Path) -> Contents:
    """Its arrays; DataError where it is damaged or unpacks out of proportion."""
    variables = mat_variables(path)
    contents = recognised(variables)
    if contents is not None:
        return contents
    return Contents(tuple(_columns(variables)), window=window_of(variables))


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
    return head.startswith((_V5, V73)) or _is_v4(head)


def _is_v4(head: bytes) -> bool:
    """Whether it begins with the header of a matrix, least or most significant byte first, and its name.

    Source: MAT-File Format (The MathWorks), level 4: type, rows, columns, whether complex, length of the name.
    """
    for order, least in (("<", 0), (">", 1000)):
        kind, rows, columns, is_complex, length = struct.unpack_from(f"{order}5i", head.ljust(20))
        sizes = rows >= 0 and columns >= 0 and is_complex in (0, 1)
        if kind - least in _V4_KINDS and sizes and _V4_NAME.fullmatch(head[20 : 20 + max(length, 0)]):
            return True
    return False


MAT = Format("mat", "MATLAB file", (".mat",), _is_mat, read_mat)
