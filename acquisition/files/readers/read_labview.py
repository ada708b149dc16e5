"""Read LabVIEW files: LVM text and TDMS.

LVM has a header, a decimal comma or point, and one time column, one for each channel, or none. TDMS is read by npTDMS
where that is installed (`pip install "lobewatch[tdms]"`).
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.errors import DataError
from acquisition.files.contents.column_headings import infer_role, split_heading
from acquisition.files.contents.contents import Contents, Format, Signal, list_distinct_names, parse_local_time
from acquisition.files.readers.number_format import parse_columns
from acquisition.files.readers.text_file import decode_text, read_text

LVM_MAGIC = "LabVIEW Measurement"
_LVM_HEADER_END = "***End_of_Header***"
_LVM_SEPARATORS = {"Tab": "\t", "Comma": ",", "Semicolon": ";"}


def read_lvm(path: Path) -> Contents:
    """Read the channels of every segment; raise DataError with the place where it fails."""
    text = read_text(path)
    lines = text.splitlines()
    ends = [i for i, line in enumerate(lines) if line.startswith(_LVM_HEADER_END)]
    if len(ends) < 2:
        raise DataError(f"{path}: incomplete LVM file, {len(ends)} of at least 2 header ends. Export the file again.")
    pairs = (re.split("[\t,;]", line, maxsplit=1) for line in lines[: ends[0]])  # its separator is in one of them
    head = {pair[0]: pair[1].strip() for pair in pairs if len(pair) == 2}
    starts = [*ends[1:], len(lines)]
    signals = list[Signal]()
    for number, places in enumerate(zip(ends, ends[1:], starts[1:], strict=False)):
        signals += _read_lvm_segment(path, lines, places, head, number)
    if not text.endswith("\n"):
        raise DataError(f"{path}: truncated file, the last line has no line end. Export the file again.")
    return Contents(tuple(signals), created=_parse_lvm_date(head))


def _read_lvm_segment(
    path: Path, lines: Sequence[str], places: tuple[int, int, int], head: Mapping[str, str], record: int
) -> list[Signal]:
    before, end, after = places
    split = _LVM_SEPARATORS.get(head.get("Separator", "Tab"), "\t")
    rows = [line.split(split) for line in lines[before + 1 : end]]
    header = {row[0].strip(): [word.strip() for word in row[1:]] for row in rows if row[0].strip()}
    several = head.get("X_Columns") == "Multi"
    try:
        n_channels = int(header["Channels"][0])
        columns = [2 * i + 1 if several else i + 1 for i in range(n_channels)]
        at = [column - 1 for column in columns]
        samples = [int(_get_word(header["Samples"], i) or 0) for i in at]
        steps = [float((_get_word(header["Delta_X"], i) or "nan").replace(",", ".")) for i in at]
    except (KeyError, ValueError, IndexError) as error:
        place = f"{path}: line {before + 2}: the segment header lacks Channels, Samples or Delta_X"
        raise DataError(f"{place} ({error})") from error
    units = [_get_word(header.get("Y_Unit_Label", []), i) for i in at]
    names = [_get_word(lines[end + 1].split(split) if end + 1 < after else [], column) for column in columns]
    table = lines[end + 2 : after]
    lengths = [None if after == len(lines) else n for n in samples]
    cells = [[_get_word(row.split(split), i) for row in table[:n]] for i, n in zip(columns, lengths, strict=True)]
    signals = list[Signal]()
    for i, found in enumerate(parse_columns(cells, range(end + 3, after + 1), head.get("Decimal_Separator", ""))):
        if samples[i]:
            n_there = found.values.size
            if n_there < samples[i]:
                raise DataError(f"{path}: truncated file, {n_there} of {samples[i]} samples. Export the file again.")
            name, by_name = split_heading(names[i] or f"channel {i + 1}")
            unit = units[i] or by_name
            rate, role = 1 / steps[i] if steps[i] > 0 else None, infer_role(name, unit)
            signal = Signal(name, found.values, role, unit, rate=rate, record=record)
            signals.append(replace(signal, n_rows=len(table), flaws=found.flaws))
    return signals


def _get_word(words: Sequence[str], i: int) -> str:
    return words[i].strip() if i < len(words) else ""


def _parse_lvm_date(head: Mapping[str, str]) -> datetime | None:
    """Return date and time of the header in the local time zone; None if they cannot be read."""
    clock = head.get("Time", "").replace(",", ".").partition(".")[0]
    return parse_local_time(f"{head.get('Date', '')} {clock}", "%Y/%m/%d %H:%M:%S")


def _is_lvm(head: bytes, _path: Path) -> bool:
    return decode_text(head).startswith(LVM_MAGIC)


def read_tdms(path: Path) -> Contents:
    """Read the channels of numbers, a record per group; raise DataError for a damaged file or without npTDMS."""
    try:
        from nptdms import TdmsFile
    except ImportError as error:
        raise DataError(f'{path}: TDMS files need the package npTDMS. Run pip install "lobewatch[tdms]".') from error
    try:
        file = TdmsFile.read(path)
        groups = file.groups()
        held = [list(_make_tdms_signals(group.channels(), i)) for i, group in enumerate(groups)]
        names = list_distinct_names(group.name for group, signals in zip(groups, held, strict=True) if signals)
        created = [_get_tdms_start(channel) for group in groups for channel in group.channels()]
    except Exception as error:
        fault = f"damaged or truncated file ({type(error).__name__}: {error})"
        raise DataError(f"{path}: {fault}. Export the file again.") from error
    return Contents(tuple(chain.from_iterable(held)), created=next(filter(None, created), None), groups=names)


def _make_tdms_signals(channels: list[Any], record: int) -> Iterator[Signal]:
    for channel in channels:
        values = channel[:]
        if values.dtype.kind in "fiu" and values.size > 1:
            name, by_name = split_heading(channel.name)
            given = channel.properties
            unit = str(given.get("unit_string", "") or given.get("NI_UnitDescription", "") or by_name)
            step = float(given.get("wf_increment", 0) or 0)
            rate = 1 / step if step > 0 else None
            yield Signal(name, values.astype(np.float64), infer_role(name, unit), unit, rate=rate, record=record)


def _get_tdms_start(channel: Any) -> datetime | None:
    """Return the start of the waveform, which TDMS has in UTC."""
    time = channel.properties.get("wf_start_time")
    if time is None:
        return None
    seconds = np.datetime64(time, "us").astype("int64") / 1e6
    return datetime.fromtimestamp(float(seconds), UTC)


LABVIEW_FORMATS = (
    Format("lvm", "LabVIEW measurement file", (".lvm",), _is_lvm, read_lvm),
    Format("tdms", "TDMS file", (".tdms",), lambda head, _path: head.startswith(b"TDSm"), read_tdms),
)
