"""Text that B&K PULSE exports: a header of keys and values, then blocks of rows.

Each row is index, abscissa and value, two numbers where it is complex. The header names the function and its unit, the
unit of the abscissa, and how many rows a block has.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path

import numpy as np

from acquisition.errors import DataError
from acquisition.files.contents.contents import Contents, Role, Signal
from acquisition.files.contents.heading import role_of
from acquisition.files.readers.format import Format
from acquisition.files.readers.numbered_lines import NumberedLines, numbered_lines
from acquisition.files.readers.row_form import RowForm, columns_of
from acquisition.files.readers.text import text_in, text_of

MAGIC = "Header Size:"
_DATE_PARTS = (("yyyy", "%Y"), ("yy", "%y"), ("MMM", "%b"), ("MM", "%m"), ("M", "%m"), ("dd", "%d"), ("d", "%d"))


def read_pulse(path: Path) -> Contents:
    """The function of every block; DataError with the place where it is cut short or its header says too little."""
    lines, _ = numbered_lines(text_of(path), 0)
    blocks = _blocks(lines)
    header = _pairs(lines.texts[: blocks[0][0]]) if blocks else {}
    try:
        is_complex, n = header["data type"].lower() == "complex", int(header["x-axis size"])
        form, sign = RowForm("\t", (1, 2, 3) if is_complex else (1, 2)), header["decimal symbol"]
    except (KeyError, ValueError) as error:
        raise DataError(f"{path}: its header lacks {error}, or no row follows it; export it anew") from error
    signals = list[Signal]()
    for record, (first, after) in enumerate(blocks):
        columns = columns_of(lines[first:after], form, str(path), sign)
        n_there = min(column.values.size for column in columns)
        if n_there != n:
            place = f"{path}: line {lines.numbers[after - 1]}"
            raise DataError(f"{place}: {n_there} of {n} rows are there; the file is cut short")
        axis, *parts = (column.values for column in columns)
        function = np.asarray(parts[0] + 1j * parts[1]) if is_complex else parts[0]
        flaws = {i: flaw for column in columns[1:] for i, flaw in column.flaws.items()}
        name, unit, over = (
            header.get("title", "function"),
            header.get("amplitudeunit", ""),
            header.get("x-axis unit", ""),
        )
        signals.append(Signal("abscissa", axis, role_of("", over), over, record=record, flaws=columns[0].flaws))
        signals.append(Signal(name, function, _role(header, unit), unit, record=record, flaws=flaws))
    return Contents(tuple(signals), created=_created(header))


def _blocks(lines: NumberedLines) -> list[tuple[int, int]]:
    """Where the rows of each block begin, and the line behind the last."""
    are_rows = [line.lstrip()[:1].isdigit() for line in lines.texts]
    edges = np.flatnonzero(np.diff([0, *are_rows, 0])).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


def _pairs(lines: Sequence[str]) -> dict[str, str]:
    """What stands behind the keys of these lines; keys in lower case."""
    parts = (line.partition(":") for line in lines)
    return {key.strip().lower(): value.strip() for key, _, value in parts if value.strip()}


def _role(header: Mapping[str, str], unit: str) -> Role:
    function = header.get("function", "").lower()
    if "response" in function:
        return "frf"
    return "coherence" if "coherence" in function else role_of("", unit) if header.get("x-axis unit") == "s" else ""


def _created(header: Mapping[str, str]) -> datetime | None:
    """Date and time of the first block, in the local time zone; None where it has none that can be read."""
    pattern = header.get("date format", "")
    for part, directive in _DATE_PARTS:
        pattern = re.sub(rf"(?<![%\w]){part}(?!\w)", directive, pattern)
    clock = ":".join(header.get("time", "").split(":")[:3])
    try:
        return datetime.strptime(f"{header.get('date', '')} {clock}", f"{pattern} %H:%M:%S").astimezone()
    except ValueError:
        return None


def _is_pulse(head: bytes, _path: Path) -> bool:
    return text_in(head).startswith(MAGIC)


PULSE = Format("pulse", "B&K PULSE text", (".txt",), _is_pulse, read_pulse)
