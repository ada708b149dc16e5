"""LabVIEW measurement files (.lvm): text with a header, decimal comma or point, one time column, one each, or none."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path

from acquisition.errors import DataError
from acquisition.files.contents.contents import Contents, Signal
from acquisition.files.contents.heading import name_and_unit, role_of
from acquisition.files.readers.format import Format
from acquisition.files.readers.numerals import read_columns
from acquisition.files.readers.text import text_in, text_of

MAGIC = "LabVIEW Measurement"
_END = "***End_of_Header***"
_SEPARATORS = {"Tab": "\t", "Comma": ",", "Semicolon": ";"}


def read_lvm(path: Path) -> Contents:
    """The channels of every segment; DataError with the place where it fails."""
    text = text_of(path)
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
    table = lines[end + 2 : after]
    lengths = [None if after == len(lines) else n for n in samples]
    cells = [[_word(row.split(split), i) for row in table[:n]] for i, n in zip(columns, lengths, strict=True)]
    signals = list[Signal]()
    for i, found in enumerate(read_columns(cells, range(end + 3, after + 1), head.get("Decimal_Separator", ""))):
        if samples[i]:
            n_there = found.values.size
            if n_there < samples[i]:
                raise DataError(f"{path}: {n_there} of {samples[i]} samples are there; the file is cut short")
            name, by_name = name_and_unit(names[i] or f"channel {i + 1}")
            unit = units[i] or by_name
            rate, role = 1 / steps[i] if steps[i] > 0 else None, role_of(name, unit)
            signal = Signal(name, found.values, role, unit, rate=rate, record=record)
            signals.append(replace(signal, n_rows=len(table), flaws=found.flaws))
    return signals


def _word(words: Sequence[str], i: int) -> str:
    return words[i].strip() if i < len(words) else ""


def _created(head: Mapping[str, str]) -> datetime | None:
    """Date and Time of the header, in the local time zone; None where it has none that can be read."""
    clock = head.get("Time", "").replace(",", ".").partition(".")[0]
    try:
        return datetime.strptime(f"{head.get('Date', '')} {clock}", "%Y/%m/%d %H:%M:%S").astimezone()
    except ValueError:
        return None


def _is_lvm(head: bytes, _path: Path) -> bool:
    return text_in(head).startswith(MAGIC)


LVM = Format("lvm", "LabVIEW measurement file", (".lvm",), _is_lvm, read_lvm)
