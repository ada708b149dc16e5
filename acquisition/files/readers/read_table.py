"""Text tables: columns of numbers, with a heading or without, as other programs and spreadsheets write them.

The separator (tab, semicolon, comma, white space), the decimal comma and the columns are found from the rows. Lines
above them are headings, of any number; the nearest with a word for each column names columns and units,
`time_s,force_N,acceleration_g`, `Time (s);Force [N];Acc [m/s^2]`, `Freq (Hz) Real (um/N) Imag (um/N)`, or a line of
units stands below the names. Lines that begin with # may say `key: value`. Some tap-test programs (.frf) write the
heading behind the first row of numbers. Complex numbers are read as Python, MATLAB and Fortran write them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import numpy as np

from acquisition.errors import DataError
from acquisition.files.contents.contents import Contents, Signal
from acquisition.files.contents.heading import is_level, role_of, unit_by_name
from acquisition.files.readers.format import Format
from acquisition.files.readers.numbered_lines import NumberedLines, numbered_lines
from acquisition.files.readers.numerals import Column, is_number
from acquisition.files.readers.row_form import RowForm, begins_with_number, columns_of, dialect, plain_complex, row_form
from acquisition.files.readers.table_heading import Heading, heading_above, heading_behind, is_unit_line
from acquisition.files.readers.text import is_text, text_of

_DIGIT = re.compile(r"\d|nan|inf", re.IGNORECASE)
_WORD = re.compile(r"[\s\"']*(?!(?:nan|inf|infinity)\b)[^\W\d_]{2}", re.IGNORECASE)
"""At the begin of a line that is no row."""
BEGIN = 3
"""Lines in a row that begin with a number where the rows of a table begin."""


def read_table(path: Path, skip: int = 0, decimal_sign: str = "") -> Contents:
    """The columns of a text file behind its first `skip` lines; DataError with the line where it is no table.

    decimal_sign: a comma or a point; empty: what the numbers show.
    """
    text = text_of(path)
    lines, comments = numbered_lines(text, skip)
    lines, footer = _without_footer(lines)
    pairs = [(key.strip().lower(), value.strip()) for key, _, value in (comment.partition(":") for comment in comments)]
    keys, machines = dict(pairs), tuple(dict.fromkeys(value for key, value in pairs if key == "machine" and value))
    signals, notes = list[Signal](), list[str]()
    for record, table in enumerate(_tables(path, lines)):
        rows, form, heading = _rows(path, table, comments)
        columns = columns_of(rows, form, str(path), decimal_sign)
        signals += _signals(columns, heading, record)
        beside = [word for i, word in enumerate(form.words(rows.texts[-1])) if word and i not in form.columns]
        notes += [f"beside its columns stands {word!r} in the last row" for word in beside]
    _check_whole(path, keys, rows, columns, text)
    notes += [f"below its rows stands {line!r}" for line in footer]
    return replace(_contents(path, tuple(signals), keys), machines=machines, notes=tuple(notes))


def _tables(path: Path, lines: NumberedLines) -> Iterator[NumberedLines]:
    """The table, or those beneath each other where a line above the rows stands again below; with their headings."""
    texts = lines.texts
    first = _first_row(path, lines)
    above = {line for line in texts[:first] if _WORD.match(line)}
    again = [i for i in range(first, len(texts)) if texts[i] in above]
    begins = dict.fromkeys(next(j for j in range(i, 0, -1) if begins_with_number(texts[j - 1])) for i in again)
    return map(lines.__getitem__, map(slice, [0, *begins], [*begins, len(texts)]))


def _without_footer(lines: NumberedLines) -> tuple[NumberedLines, Sequence[str]]:
    """Lines up to the last that may be a row, and words behind it."""
    form = dialect(lines.texts[-1:] or [""])
    last = next((i for i in range(len(lines.texts), 0, -1) if _may_be_row(lines.texts[i - 1], form)), 0)
    return (lines[:last], lines.texts[last:]) if last else (lines, [])


def _may_be_row(line: str, form: RowForm) -> bool:
    """Whether it has a digit, and more than one number where it begins with a word."""
    return bool(_DIGIT.search(line)) and (not _WORD.match(line) or sum(map(is_number, form.words(line))) > 1)


def _signals(columns: Sequence[Column], heading: Heading, record: int) -> list[Signal]:
    """Columns with their names, units and what they therefore are; heading: empty where there is none."""
    n_rows = max((column.values.size for column in columns), default=0)
    named = zip(heading or [("", "")] * len(columns), columns, strict=True)
    return [
        replace(_signal(name or f"column {i}", unit, column), record=record, n_rows=n_rows)
        for i, ((name, unit), column) in enumerate(named, 1)
    ]


def _signal(name: str, unit: str, column: Column) -> Signal:
    """Complex numbers are an FRF, and real ones none."""
    values, flaws = column.values, column.flaws
    if np.iscomplexobj(values):
        return Signal(name, values, "frf", unit, flaws=flaws)
    unit = unit_by_name(name, unit)
    role = "magnitude" if is_level(unit) else role_of(name, unit)
    return Signal(name, values, "" if role == "frf" else role, unit, flaws=flaws)


def _rows(path: Path, lines: NumberedLines, comments: Sequence[str]) -> tuple[NumberedLines, RowForm, Heading]:
    """The rows, how they are written, and the heading above them, behind the first or among comments."""
    first = _first_row(path, lines)
    begin = max(first - 1, 0)  # of the row that may have the heading behind it
    plain = NumberedLines([*map(plain_complex, lines.texts[begin:])], lines.numbers[begin:])
    form = row_form(plain.texts[first - begin :])
    if not form.columns:
        cure = "pass over what stands above them with --skip"
        raise DataError(f"{path}: line {lines.numbers[first]}: no rows of numbers begin here; {cure}")
    width = len(form.words(plain.texts[first - begin :][:2][-1]))
    if not _begins_in_column(plain.texts[first - begin], form) and is_unit_line(lines.texts[:first], form, width):
        first += 1  # it holds ranges
    for at in (first, begin):
        if heading := heading_behind(plain.texts[at - begin], form):
            return plain[at - begin :], form, heading
    _refuse_broken_row(path, lines[:first], form, width)
    return plain[first - begin :], form, heading_above([*comments, *lines.texts[:first]], form, width)


def _begins_in_column(line: str, form: RowForm) -> bool:
    """Whether the first of the columns holds a number in this line."""
    words = form.words(line)
    return form.columns[0] < len(words) and is_number(words[form.columns[0]])


def _first_row(path: Path, lines: NumberedLines) -> int:
    texts = lines.texts
    begins = [begins_with_number(line) for line in texts[:BEGIN]]
    for i in range(len(texts)):
        if all(begins[i : i + BEGIN]) and len(texts) > 1:
            return i
        begins += [begins_with_number(line) for line in texts[i + BEGIN : i + BEGIN + 1]]
    if len(texts) < 2:
        raise DataError(f"{path}: {len(texts)} lines; a heading and rows of numbers are needed")
    raise DataError(f"{path}: line {lines.numbers[1]}: {texts[1].strip()[:60]!r} is no row of numbers")


def _refuse_broken_row(path: Path, above: NumberedLines, form: RowForm, width: int) -> None:
    """DataError where the last line above the rows may be one of them; below a line of units it holds ranges."""
    words = form.words(plain_complex(above.texts[-1])) if above.texts else []
    numbers = sum(map(is_number, words))
    may_be_row = len(words) == width and 2 * numbers >= len(form.columns) and not _WORD.match(above.texts[-1])
    if may_be_row and not is_unit_line(above.texts[-2:-1], form, width):
        cure = f"mend it, or pass over what stands above the rows with --skip {above.numbers[-1]}"
        place = f"{path}: line {above.numbers[-1]}"
        raise DataError(f"{place}: {above.texts[-1].strip()[:60]!r} is no row of numbers; {cure}")


def _check_whole(
    path: Path, keys: Mapping[str, str], rows: NumberedLines, columns: Sequence[Column], text: str
) -> None:
    """DataError where the last row has no line end and lacks a number, or our table is not as its heading says."""
    last, has_end = f"{path}: line {rows.numbers[-1]}", text.endswith(("\n", "\r"))
    if not has_end and any(column.values.size == len(rows.texts) - 1 for column in columns):
        raise DataError(f"{last} ends within its row: the file is cut short; export it anew, or take out that line")
    rows_written = keys.get("rows")
    if rows_written is None or keys.get("written by") != "lobewatch":
        return  # of another program, or of our first versions
    cure = "convert it anew, or take out the line that begins with # rows"
    if rows_written != str(len(rows.texts)):
        raise DataError(f"{last} ends row {len(rows.texts)} of {rows_written}: cut short or altered; {cure}")
    if not has_end:
        raise DataError(f"{last} has no line end, so that its last number may be cut short; {cure}")


def _contents(path: Path, signals: tuple[Signal, ...], keys: Mapping[str, str]) -> Contents:
    averages, recorded, direction, tool = (keys.get(key, "") for key in ("averages", "recorded", "direction", "tool"))
    try:
        created = datetime.fromisoformat(recorded).astimezone() if recorded else None
        n_averages = int(averages) if averages else None
    except ValueError as error:
        raise DataError(f"{path}: {error} (lines that begin with #: {dict(keys)})") from error
    return Contents(signals, n_averages, created, direction, tool, window=keys.get("window", ""))


def _is_text(head: bytes, _path: Path) -> bool:
    return is_text(head)


TEXT_TABLE = Format(
    "table", "text table", (".csv", ".txt", ".frf", ".dat", ".asc"), _is_text, read_table, read_from=read_table
)
