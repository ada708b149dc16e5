"""Text tables: columns of numbers, with a heading or without, as other programs and spreadsheets write them.

The separator (tab, semicolon, comma, white space) and the decimal comma are found from the rows. Lines before the first
row are headings; the last of them names columns and units, `time_s,force_N,acceleration_g`, `Time (s);Force [N];Acc
[m/s^2]`, `Freq (Hz) Real (um/N) Imag (um/N)`, or a line of units stands below the names. Lines that begin with # may
say `key: value`. Some tap-test programs (.frf) write the heading behind the first row of numbers.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquisition.errors import DataError
from acquisition.files.contents.contents import Contents, Signal
from acquisition.files.contents.heading import is_level, is_unit, name_and_unit, role_of
from acquisition.files.readers.format import Format
from acquisition.files.readers.text import is_text, text_of

_COMMA_NUMBER = re.compile(r"[+-]?\d+(,\d+)?([eE][+-]?\d+)?")
_NOT_FINITE = {"nan", "inf", "-inf", "+inf"}


@dataclass
class Layout:
    """How the rows of a table are written."""

    separator: str
    """Pattern between two words of a row."""
    comma: bool
    """Whether the decimal sign is a comma."""
    heading: list[str] = field(default_factory=list)
    """Words above the columns, or behind the first row; empty where there are none."""
    keys: dict[str, str] = field(default_factory=dict)
    """Values by the keys of lines that begin with #, the last of each."""
    machines: tuple[str, ...] = ()
    """All machines that these lines name."""

    def words(self, line: str) -> list[str]:
        """The words of a line."""
        line = line.strip(" \r\n") if self.separator == "\t" else line.strip()
        return [word.strip().strip('"') for word in re.split(self.separator, line)]

    def number(self, word: str) -> float:
        """A word as a number; ValueError where it is none."""
        return float(word.replace(",", ".") if self.comma else word)


@dataclass(frozen=True)
class NumberedLines:
    """Some lines of a file."""

    texts: Sequence[str]
    """Lines without their ends."""
    numbers: Sequence[int]
    """Number of each line, from 1 on."""

    def __getitem__(self, part: slice) -> NumberedLines:
        """Some of them."""
        return NumberedLines(self.texts[part], self.numbers[part])


def read_table(path: Path) -> Contents:
    """The columns of a text file; DataError with the line where it is no table."""
    text = text_of(path)
    lines, comments = _lines(text)
    first, layout = _layout(path, lines)
    pairs = [(key.strip().lower(), value.strip()) for key, _, value in (comment.partition(":") for comment in comments)]
    layout.keys = dict(pairs)
    layout.machines = tuple(dict.fromkeys(value for key, value in pairs if key == "machine" and value))
    rows = lines[first:]
    behind = _behind(layout, rows.texts)
    layout.heading = behind or layout.heading
    width = len(layout.words(rows.texts[-1])) if behind else len(_trimmed(layout, rows.texts[0]))
    if layout.heading and not behind and width != len(layout.heading):
        raise DataError(f"{path}: line {rows.numbers[0]}: {width} numbers under {len(layout.heading)} headings")
    _check_whole(path, layout, rows, text)
    values = _values(path, layout, rows, width)
    return _contents(path, layout, values)


def _check_whole(path: Path, layout: Layout, rows: NumberedLines, text: str) -> None:
    """DataError where a table that we wrote has other rows than its heading says, or ends within the last of them."""
    rows_written = layout.keys.get("rows")
    if rows_written is None or layout.keys.get("written by") != "lobewatch":
        return  # of another program, or of our first versions
    last = f"{path}: line {rows.numbers[-1]}"
    cure = "convert it anew, or take out the line that begins with # rows"
    if rows_written != str(len(rows.texts)):
        raise DataError(f"{last} ends row {len(rows.texts)} of {rows_written}: cut short or altered; {cure}")
    if not text.endswith(("\n", "\r")):
        raise DataError(f"{last} has no line end, so that its last number may be cut short; {cure}")


def _lines(text: str) -> tuple[NumberedLines, list[str]]:
    """Those that are not empty, and what stands behind # in others."""
    texts = text.splitlines()
    if "#" not in text and all(map(str.strip, texts)):
        return NumberedLines(texts, range(1, len(texts) + 1)), []
    numbered = [(line, number) for number, line in enumerate(texts, 1) if line.strip()]
    comments = [line.strip()[1:] for line, _ in numbered if line.lstrip().startswith("#")]
    numbered = [entry for entry in numbered if not entry[0].lstrip().startswith("#")]
    return NumberedLines([line for line, _ in numbered], [number for _, number in numbered]), comments


def _layout(path: Path, lines: NumberedLines) -> tuple[int, Layout]:
    """Where the rows begin, how they are written, and the heading above them."""
    texts = lines.texts
    first = next((i for i, line in enumerate(texts) if _starts_with_number(_dialect([line]), line)), None)
    if first is not None and len(texts) > max(first, 1):
        layout = _dialect(texts[first:])
        layout.heading = _heading(layout, texts[:first])
        return first, layout
    if len(texts) < 2:
        raise DataError(f"{path}: {len(texts)} lines; a heading and rows of numbers are needed")
    raise DataError(f"{path}: line {lines.numbers[1]}: {texts[1].strip()[:60]!r} is no row of numbers")


def _dialect(rows: Sequence[str]) -> Layout:
    """How rows are written; the first one with a comma tells what that is."""
    with_comma = next((row for row in rows if "," in row), "")
    for separator in ("\t", ";"):
        if separator in rows[0].strip():
            return Layout(separator, bool(with_comma))
    words = with_comma.split()
    if len(words) > 1 and all(map(_COMMA_NUMBER.fullmatch, words)):
        return Layout(r"\s+", comma=True)
    return Layout("," if with_comma else r"\s+", comma=False)


def _starts_with_number(layout: Layout, line: str) -> bool:
    word = layout.words(line)[0]
    try:
        layout.number(word)
    except ValueError:
        return False
    return word.lower() not in _NOT_FINITE


def _trimmed(layout: Layout, line: str) -> list[str]:
    """The words of a row without an empty one behind its last separator."""
    words = layout.words(line)
    return words[:-1] if len(words) > 1 and not words[-1] else words


def _heading(layout: Layout, lines: Sequence[str]) -> list[str]:
    """The last line above the rows, with the units that stand in a line of their own below it."""
    if not lines:
        return []
    if layout.separator == r"\s+":
        lines = [re.sub(r"\s+(?=[\[(])", "", line) for line in lines]
    last = _trimmed(layout, lines[-1])
    if len(lines) > 1:
        names, bare = _trimmed(layout, lines[-2]), [word.strip("()[] ") for word in last]
        if len(names) == len(last) and all(not unit or unit == "-" or is_unit(unit) for unit in bare):
            return [f"{name} [{unit}]" if unit.strip("-") else name for name, unit in zip(names, bare, strict=True)]
    return last


def _behind(layout: Layout, rows: Sequence[str]) -> list[str]:
    """The heading behind the numbers of the first row: a name and a unit for each column, or names only."""
    words, width = layout.words(rows[0]), len(_trimmed(layout, rows[-1]))
    names = [word for word in words[width:] if word]
    if len(names) == 2 * width:
        pairs = zip(names[::2], names[1::2], strict=True)
        return [f"{name} [{unit}]" if is_unit(unit) else name for name, unit in pairs]
    return names if len(names) == width else []


def _values(path: Path, layout: Layout, rows: NumberedLines, width: int) -> NDArray[np.float64]:
    """Shape (n_columns, n_rows)."""
    values = _at_once(layout, rows.texts, width)
    return _one_by_one(path, layout, rows, width) if values is None else values


def _at_once(layout: Layout, rows: Sequence[str], width: int) -> NDArray[np.float64] | None:
    """The same where all rows are alike, many times as fast; None where they have to be looked at one by one."""
    if layout.separator == r"\s+":
        widths, words = {len(row.split()) for row in rows}, " ".join(rows).split()
    else:
        widths = {row.count(layout.separator) + 1 for row in rows}
        words = layout.separator.join(rows).split(layout.separator)
    if widths != {width}:
        return None
    try:
        values = [*map(float, (word.replace(",", ".") for word in words) if layout.comma else words)]
    except ValueError:
        return None
    return np.array(values).reshape(len(rows), width).T


def _one_by_one(path: Path, layout: Layout, rows: NumberedLines, width: int) -> NDArray[np.float64]:
    values = np.empty((len(rows.texts), width))
    for i, (line, number) in enumerate(zip(rows.texts, rows.numbers, strict=True)):
        words = _trimmed(layout, line)
        if len(words) != width and not (i == 0 and len(words) > width):
            under = f"under {width} headings" if layout.heading else f"where the first row has {width}"
            raise DataError(f"{path}: line {number}: {len(words)} numbers {under}")
        try:
            values[i] = [layout.number(word) for word in words[:width]]
        except ValueError as error:
            raise DataError(f"{path}: line {number}: {line.strip()[:60]!r} is no row of numbers") from error
    return values.T


def _contents(path: Path, layout: Layout, values: NDArray[np.float64]) -> Contents:
    headings = [name_and_unit(word) for word in layout.heading] or [("", "")] * len(values)
    signals = [
        Signal(name or f"column {i}", row, role_of(name, unit), unit)
        for i, ((name, unit), row) in enumerate(zip(headings, values, strict=True), 1)
    ]
    signals = [_with_level(signal) for signal in signals]
    texts, keys = iter(layout.keys.get(key, "") for key in ("averages", "recorded", "direction", "tool")), layout.keys
    averages, recorded, direction, tool = texts
    try:
        created = datetime.fromisoformat(recorded).astimezone() if recorded else None
        n_averages = int(averages) if averages else None
    except ValueError as error:
        raise DataError(f"{path}: {error} (lines that begin with #: {keys})") from error
    window = keys.get("window", "")
    return Contents(tuple(signals), n_averages, created, direction, tool, layout.machines, window)


def _with_level(signal: Signal) -> Signal:
    """Of a magnitude in "dB re 1 m/N" the unit, of one in dB that."""
    level = re.fullmatch(r"dB\s*(?:re|ref|rel)\.?\s*1?\s*(.+)", signal.unit, re.IGNORECASE)
    if is_level(signal.unit):
        return replace(signal, role="magnitude", unit=f"dB {level[1]}" if level else "dB")
    return signal


def _is_text(head: bytes, _path: Path) -> bool:
    return is_text(head)


TEXT_TABLE = Format("table", "text table", (".csv", ".txt", ".frf", ".dat", ".asc"), _is_text, read_table)
