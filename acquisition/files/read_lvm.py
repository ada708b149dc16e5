"""LabVIEW measurement files (.lvm): text with a header, decimal comma or point."""

from __future__ import annotations

import itertools
from datetime import datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquisition.errors import DataError
from acquisition.files.format import Format
from acquisition.files.units import hit_from
from acquisition.hit import Hit
from acquisition.tap import Circumstances

MAGIC = b"LabVIEW Measurement"
_END = "***End_of_Header***"


def read_lvm(path: Path) -> list[Hit]:
    """One hit a segment; columns are told apart by their unit labels. DataError with the place where it fails."""
    lines = path.read_text(encoding="latin-1").splitlines()
    ends = [i for i, line in enumerate(lines) if line.startswith(_END)]
    if len(ends) < 2:
        raise DataError(f"{path}: LVM file with {len(ends)} of at least 2 header ends; is it cut short?")
    head = [line.split("\t")[:2] for line in lines[: ends[0]]]
    if ["X_Columns", "Multi"] in head:
        raise DataError(f"{path}: each channel has its own time column (X_Columns Multi); export it with one or none")
    comma = ["Decimal_Separator", ","] in head
    starts = [*ends[1:], len(lines)]
    return [
        _read_segment(path, lines, (before, end, after), comma)
        for before, end, after in zip(ends, ends[1:], starts[1:], strict=False)
    ]


def _read_segment(path: Path, lines: list[str], places: tuple[int, int, int], comma: bool) -> Hit:
    before, end, after = places
    header = {words[0]: words[1:] for words in (line.split("\t") for line in lines[before + 1 : end]) if words[0]}
    try:
        units = [unit for unit in header["Y_Unit_Label"] if unit]
        n_samples = int(header["Samples"][0])
        step = float(header["Delta_X"][0].replace(",", "."))
    except (KeyError, ValueError, IndexError) as error:
        raise DataError(
            f"{path}: line {before + 2}: the segment's header lacks Samples, Delta_X or Y_Unit_Label ({error})"
        ) from error
    first = end + 2
    rows = lines[first : first + n_samples]
    if len(rows) < n_samples or first + n_samples > after:
        raise DataError(
            f"{path}: {min(len(rows), after - first)} of {n_samples} samples are there; the file is cut short"
        )
    columns = _numbers(path, rows, first + 1, len(units), comma)
    return hit_from(path, list(zip(units, columns, strict=True)), 1 / step)


def _numbers(path: Path, rows: list[str], first_line: int, n: int, comma: bool) -> NDArray[np.float64]:
    """The n channel columns, shape (n, n_samples); the time column before them may be empty."""
    values = np.empty((n, len(rows)))
    for i, row in enumerate(rows):
        words = (row.replace(",", ".") if comma else row).split("\t")[1 : n + 1]
        try:
            values[:, i] = [float(word) for word in words]
        except ValueError as error:
            raise DataError(f"{path}: line {first_line + i}: {row.strip()!r} are not {n} numbers") from error
    return values


def _is_lvm(head: bytes, _path: Path) -> bool:
    return head.startswith(MAGIC)


def _recorded_as(path: Path) -> Circumstances | None:
    """Date and Time of the header, in the local time zone; None where it has none that can be read."""
    with path.open(encoding="latin-1") as file:
        words = dict(line.rstrip("\n").split("\t")[:2] for line in itertools.islice(file, 12) if "\t" in line)
    try:
        clock = words["Time"].replace(",", ".").partition(".")[0]
        return Circumstances("", datetime.strptime(f"{words['Date']} {clock}", "%Y/%m/%d %H:%M:%S").astimezone())
    except (KeyError, ValueError):
        return None


LVM = Format("lvm", "LabVIEW measurement file", (".lvm",), _is_lvm, read_lvm, _recorded_as)
