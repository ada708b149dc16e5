"""LabVIEW measurement files (.lvm): text with a header, decimal comma or point, one time column, one each, or none."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquisition.errors import DataError
from acquisition.files.contents.contents import Contents, Signal
from acquisition.files.contents.heading import name_and_unit, role_of
from acquisition.files.readers.format import Format

MAGIC = b"LabVIEW Measurement"
_END = "***End_of_Header***"
_SEPARATORS = {"Tab": "\t", "Comma": ",", "Semicolon": ";"}


def read_lvm(path: Path) -> Contents:
    """The channels of every segment; DataError with the place where it fails."""
    text = path.read_text(encoding="latin-1")
    lines = text.splitlines()
    ends = [i for i, line in enumerate(lines) if line.startswith(_END)]
    if len(ends) < 2:
        raise DataError(f"{path}: LVM file with {len(ends)} of at least 2 header ends; is it cut short?")
    pairs = (re.split("[\t,;]", line, maxsplit=1) for line in lines[: ends[0]])  # its separator stands in one of them
    head = {pair[0]: pair[1].strip() for pair in pairs if len(pair) == 2}
    starts = [*ends[1:], len(lines)]
    signals = [
        signal
        for number, places in enumerate(zip(ends, ends[1:], starts[1:], strict=False))
        for signal in _segment(path, lines, places, head, number)
    ]
    if not text.endswith("\n"):
        raise DataError(f"{path}: its last line has no end, so digits may be missing; the file is cut short")
    return Contents(tuple(signals), created=_created(head))


def _segment(
    path: Path, lines: Sequence[str], places: tuple[int, int, int], head: Mapping[str, str], record: int
) -> list[Signal]:
    before, end, after = places
    split = _SEPARATORS.get(head.get("Separator", "Tab"), "\t")
    rows = [line.split(split) for line in lines[before + 1 : end]]
    header = {row[0].strip(): [word.strip() for word in row[1:]] for row in rows if row[0].strip()}
    several = head.get("X_Columns") == "Multi"
    try:
        n_channels = int(header["Channels"][0])
        columns = [2 * i + 1 if several else i + 1 for i in range(n_channels)]
        at = [column - 1 for column in columns]
        samples = [int(_word(header["Samples"], i) or 0) for i in at]
        steps = [float((_word(header["Delta_X"], i) or "nan").replace(",", ".")) for i in at]
    except (KeyError, ValueError, IndexError) as error:
        place = f"{path}: line {before + 2}: the segment's header lacks Channels, Samples or Delta_X"
        raise DataError(f"{place} ({error})") from error
    units = [_word(header.get("Y_Unit_Label", []), i) for i in at]
    names = [_word(lines[end + 1].split(split) if end + 1 < after else [], column) for column in columns]
    signals = list[Signal]()
    for i, column in enumerate(columns):
        if samples[i]:
            cells = _column(path, lines, (end + 2, after, column, samples[i]), split, _comma(head, lines, end, split))
            name, by_name = name_and_unit(names[i] or f"channel {i + 1}")
            unit = units[i] or by_name
            rate = 1 / steps[i] if steps[i] > 0 else None
            signals.append(Signal(name, cells, role_of(name, unit), unit, rate=rate, record=record))
    return signals


def _word(words: Sequence[str], i: int) -> str:
    return words[i].strip() if i < len(words) else ""


def _comma(head: Mapping[str, str], lines: Sequence[str], end: int, split: str) -> bool:
    """Whether the decimal sign is a comma; where the header does not say, as the first row has it."""
    sign = head.get("Decimal_Separator", "")
    return sign == "," if sign else split != "," and "," in (lines[end + 2] if end + 2 < len(lines) else "")


def _column(
    path: Path, lines: Sequence[str], place: tuple[int, int, int, int], split: str, comma: bool
) -> NDArray[np.float64]:
    """One channel; place: its first line, the line after the last, the column, and how many values it should have."""
    first, after, column, n = place
    last = after if after == len(lines) else min(after, first + n)
    while last > first and not _word(lines[last - 1].split(split), column):
        last -= 1  # other channels may be longer
    if last - first < n:
        raise DataError(f"{path}: {last - first} of {n} samples are there; the file is cut short")
    values = np.empty(last - first)
    for i, line in enumerate(lines[first:last]):
        words = line.split(split)
        try:
            values[i] = float(words[column].replace(",", ".") if comma else words[column])
        except (ValueError, IndexError) as error:
            text = line.strip()[:60]
            raise DataError(f"{path}: line {first + i + 1}: {text!r} has no number in column {column + 1}") from error
    return values


def _created(head: Mapping[str, str]) -> datetime | None:
    """Date and Time of the header, in the local time zone; None where it has none that can be read."""
    clock = head.get("Time", "").replace(",", ".").partition(".")[0]
    try:
        return datetime.strptime(f"{head.get('Date', '')} {clock}", "%Y/%m/%d %H:%M:%S").astimezone()
    except ValueError:
        return None


def _is_lvm(head: bytes, _path: Path) -> bool:
    return head.startswith(MAGIC)


LVM = Format("lvm", "LabVIEW measurement file", (".lvm",), _is_lvm, read_lvm)
