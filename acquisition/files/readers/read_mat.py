"""MATLAB files, v4, v5 and v7.3: all arrays of numbers in them by name, and what those of known layouts are."""

from __future__ import annotations

import re
import struct
from pathlib import Path

from acquisition.files.contents.contents import Contents
from acquisition.files.readers.array_columns import columns_of
from acquisition.files.readers.format import Format
from acquisition.files.readers.mat_layouts import recognised
from acquisition.files.readers.mat_variables import V73, mat_variables
from acquisition.files.readers.mat_window import window_of

_V5 = b"MATLAB 5.0 MAT-file"
_V4_KINDS = range(53)
_V4_NAME = re.compile(rb"[A-Za-z]\w*\0")


def read_mat(path: Path) -> Contents:
    """Its arrays; DataError where it is damaged or unpacks out of proportion."""
    variables = mat_variables(path)
    contents = recognised(variables)
    if contents is not None:
        return contents
    return Contents(tuple(columns_of(variables)), window=window_of(variables))


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


MAT = Format("mat", "MATLAB file", (".mat", ".vna"), _is_mat, read_mat)
