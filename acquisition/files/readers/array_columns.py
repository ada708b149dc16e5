"""Arrays by name, of no layout that is known, as signals: `--columns` says what each is."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.files.contents.contents import Signal

MOST_COLUMNS = 64
"""Columns of an array that are told one by one."""
FEWEST_LINES = 8
"""Complex numbers that may be an FRF; fewer are poles."""


def columns_of(variables: Mapping[str, Any], glue: str = ".", prefix: str = "") -> Iterator[Signal]:
    """Every row of two or more numbers; those of an array of several dimensions, along its longest, as name:1, name:2.

    glue: what stands between the names of groups. Complex ones are FRFs.
    """
    for name, value in variables.items():
        if isinstance(value, Mapping):
            yield from columns_of(value, glue, f"{prefix}{name}{glue}")
        elif isinstance(value, list):
            yield from columns_of({str(i): part for i, part in enumerate(value, 1)}, glue, f"{prefix}{name}:")
        elif isinstance(value, np.ndarray) and value.dtype.kind in "fiuc":
            yield from _of_array(f"{prefix}{name}", value)


def _of_array(name: str, value: NDArray[Any]) -> Iterator[Signal]:
    if value.ndim == 1 and value.size > 1:
        yield _signal(name, value)
    elif value.ndim > 1 and value.size > 1:
        columns = np.moveaxis(value, int(np.argmax(value.shape)), -1).reshape(-1, max(value.shape))
        yield from (_signal(f"{name}:{i}", column) for i, column in enumerate(columns[:MOST_COLUMNS], 1))


def _signal(name: str, column: NDArray[Any]) -> Signal:
    """Numbers that have no imaginary part at all are real: MATLAB has one type for all columns of a matrix."""
    if not np.iscomplexobj(column) or not np.any(column.imag):
        return Signal(name, column.real)
    return Signal(name, column, "frf" if column.size >= FEWEST_LINES else "")
