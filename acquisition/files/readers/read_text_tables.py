"""Read text tables of numbers and B&K PULSE text.

The separator (tab, semicolon, comma, blanks), the decimal comma and the columns of a table are found from its rows.
Lines above them are headings, of any number. The nearest with a word for each column names columns and units,
`time_s,force_N,acceleration_g`, `Time (s);Force [N];Acc [m/s^2]`, `Freq (Hz) Real (um/N) Imag (um/N)`, or a line of
units is below the names. Lines that begin with # may say `key: value`. Some tap-test programs (.frf) write the heading
behind the first row. Complex numbers are read as Python, MATLAB and Fortran write them.

B&K PULSE exports a header of keys and values, then blocks of rows: index, abscissa and value, two numbers where it is
complex. The header names the function and its unit, the unit of the abscissa, and the number of rows of a block.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import numpy as np

from acquisition.errors import DataError
from acquisition.files.contents.column_headings import infer_decibel_unit, infer_role, is_decibel
from acquisition.files.contents.contents import Contents, Format, Role, Signal, parse_local_time
from acquisition.files.readers import table_layout as layout
from acquisition.files.readers.number_format import Column, is_number
from acquisition.files.readers.text_file import NumberedLines, decode_text, is_text, number_lines, read_text

_DIGIT = re.compile(r"\d|nan|inf", re.IGNORECASE)
_LEADING_WORD = re.compile(r"[\s\"']*(?!(?:nan|inf|infinity)\b)[^\W\d_]{2}", re.IGNORECASE)
"""Word at the beginning of a line that is no row."""
MIN_TABLE_ROWS = 3
"""Number of consecutive lines with a number at their beginning where a table begins."""


def read_table(path: Path, skip: int = 0, decimal_sign: str = "") -> Contents:
    """Read the columns of a text file after its first `skip` lines; raise DataError with the line where it is no table.

    decimal_sign: a comma or a point; empty: as the numbers show.
    """
    text = read_text(path)
    lines, comments = number_lines(text, skip)
    lines, footer = _remove_footer(lines)
    pairs = [(key.strip().lower(), value.strip()) for key, _, value in (comment.partition(":") for comment in comments)]
    keys, machines = dict(pairs), tuple(dict.fromkeys(value for key, value in pairs if key == "machine" and value))
    signals, notes = list[Signal](), list[str]()
    for record, table in enumerate(_split_tables(path, lines)):
        rows, form, heading = _find_rows(path, table, comments)
        columns = layout.read_columns(rows, form, str(path), decimal_sign)
        signals += _name_columns(columns, heading, record)
        extras = [word for i, word in enumerate(form.split(rows.texts[-1])) if word and i not in form.columns]
        notes += [f"ignored {word!r} outside the columns in the last row" for word in extras]
    _check_complete(path, keys, rows, columns, text)
    notes += [f"ignored {line!r} below the rows" for line in footer]
    return replace(_make_table_contents(path, tuple(signals), keys), machines=machines, notes=tuple(notes))


def _split_tables(path: Path, lines: NumberedLines) -> Iterator[NumberedLines]:
    """Split a file into its tables with their headings, where a line above the rows comes again below."""
    texts = lines.texts
    first = _find_first_row(path, lines)
    above = {line for line in texts[:first] if _LEADING_WORD.match(line)}
    again = [i for i in range(first, len(texts)) if texts[i] in above]
    begins = dict.fromkeys(next(j for j in range(i, 0, -1) if layout.begins_with_number(texts[j - 1])) for i in again)
    return map(lines.__getitem__, map(slice, [0, *begins], [*begins, len(texts)]))


def _remove_footer(lines: NumberedLines) -> tuple[NumberedLines, Sequence[str]]:
    """Return the lines up to the last that may be a row, and the words behind it."""
    form = layout.detect_separator(lines.texts[-1:] or [""])
    last = next((i for i in range(len(lines.texts), 0, -1) if _may_be_row(lines.texts[i - 1], form)), 0)
    return (lines[:last], lines.texts[last:]) if last else (lines, [])


def _may_be_row(line: str, form: layout.RowLayout) -> bool:
    """Return whether a line has a digit, and more than one number where it begins with a word."""
    return bool(_DIGIT.search(line)) and (not _LEADING_WORD.match(line) or sum(map(is_number, form.split(line))) > 1)


def _name_columns(columns: Sequence[Column], heading: layout.Heading, record: int) -> list[Signal]:
    """Return the columns with their names, units and roles; heading: empty without one."""
    n_rows = max((column.values.size for column in columns), default=0)
    named = zip(heading or [("", "")] * len(columns), columns, strict=True)
    return [
        replace(_make_column_signal(name or f"column {i}", unit, column), record=record, n_rows=n_rows)
        for i, ((name, unit), column) in enumerate(named, 1)
    ]


def _make_column_signal(name: str, unit: str, column: Column) -> Signal:
    """Make a signal: complex numbers are an FRF, real ones are none."""
    values, flaws = column.values, column.flaws
    if np.iscomplexobj(values):
        return Signal(name, values, "frf", unit, flaws=flaws)
    unit = infer_decibel_unit(name, unit)
    role = "magnitude" if is_decibel(unit) else infer_role(name, unit)
    return Signal(name, values, "" if role == "frf" else role, unit, flaws=flaws)


def _find_rows(
    path: Path, lines: NumberedLines, comments: Sequence[str]
) -> tuple[NumberedLines, layout.RowLayout, layout.Heading]:
    """Return the rows, their layout, and the heading above them, behind the first or among comments."""
    first = _find_first_row(path, lines)
    begin = max(first - 1, 0)  # of the row that may have the heading behind it
    plain = NumberedLines([*map(layout.normalize_complex, lines.texts[begin:])], lines.numbers[begin:])
    form = layout.detect_row_layout(plain.texts[first - begin :])
    if not form.columns:
        cure = "Skip the lines above the table with Description.skip."
        raise DataError(f"{path}: line {lines.numbers[first]}: no table of numbers found. {cure}")
    width = len(form.split(plain.texts[first - begin :][:2][-1]))
    above = lines.texts[:first]
    if layout.is_unit_line(above, form, width) and not _begins_in_column(plain.texts[first - begin], form):
        first += 1  # it holds ranges
    for at in (first, begin):
        if heading := layout.find_heading_behind(plain.texts[at - begin], form):
            return plain[at - begin :], form, heading
    _reject_broken_row(path, lines[:first], form, width)
    return plain[first - begin :], form, layout.find_heading_above([*comments, *lines.texts[:first]], form, width)


def _begins_in_column(line: str, form: layout.RowLayout) -> bool:
    """Return whether the first of the columns holds a number in this line."""
    words = form.split(line)
    return form.columns[0] < len(words) and is_number(words[form.columns[0]])


def _find_first_row(path: Path, lines: NumberedLines) -> int:
    texts = lines.texts
    begins = [layout.begins_with_number(line) for line in texts[:MIN_TABLE_ROWS]]
    for i in range(len(texts)):
        if all(begins[i : i + MIN_TABLE_ROWS]) and len(texts) > 1:
            return i
        begins += [layout.begins_with_number(line) for line in texts[i + MIN_TABLE_ROWS : i + MIN_TABLE_ROWS + 1]]
    if len(texts) < 2:
        raise DataError(f"{path}: {len(texts)} lines are too few for a heading and rows of numbers")
    raise DataError(f"{path}: line {lines.numbers[1]}: {texts[1].strip()[:60]!r} is not a row of numbers")


def _reject_broken_row(path: Path, above: NumberedLines, form: layout.RowLayout, width: int) -> None:
    """Raise DataError where the last line above the rows may be one of them; below a line of units it holds ranges."""
    words = form.split(layout.normalize_complex(above.texts[-1])) if above.texts else []
    numbers = sum(map(is_number, words))
    may_be_row = len(words) == width and 2 * numbers >= len(form.columns) and not _LEADING_WORD.match(above.texts[-1])
    if may_be_row and not layout.is_unit_line(above.texts[-2:-1], form, width):
        cure = f"Correct this line, or skip the lines above the table with Description.skip {above.numbers[-1]}."
        place = f"{path}: line {above.numbers[-1]}"
        raise DataError(f"{place}: {above.texts[-1].strip()[:60]!r} is not a row of numbers. {cure}")


def _check_complete(
    path: Path, keys: Mapping[str, str], rows: NumberedLines, columns: Sequence[Column], text: str
) -> None:
    """Raise DataError where the last row is cut short, or a table of lobewatch differs from its heading."""
    last, has_end = f"{path}: truncated at line {rows.numbers[-1]}", text.endswith(("\n", "\r"))
    if not has_end and any(column.values.size == len(rows.texts) - 1 for column in columns):
        raise DataError(f"{last}, an incomplete row. Export the recording again, or remove this line.")
    rows_written = keys.get("rows")
    if rows_written is None or keys.get("written by") != "lobewatch":
        return  # of another program, or of our first versions
    cure = "Convert the recording again, or remove the line that begins with # rows."
    if rows_written != str(len(rows.texts)):
        raise DataError(f"{path}: {len(rows.texts)} of {rows_written} rows, truncated or edited. {cure}")
    if not has_end:
        raise DataError(f"{last}, which has no line end. {cure}")


def _make_table_contents(path: Path, signals: tuple[Signal, ...], keys: Mapping[str, str]) -> Contents:
    averages, recorded, direction, tool = (keys.get(key, "") for key in ("averages", "recorded", "direction", "tool"))
    try:
        created = datetime.fromisoformat(recorded).astimezone() if recorded else None
        n_averages = int(averages) if averages else None
    except ValueError as error:
        raise DataError(f"{path}: {error} (# lines {dict(keys)})") from error
    return Contents(signals, n_averages, created, direction, tool, window=keys.get("window", ""))


PULSE_MAGIC = "Header Size:"
_PULSE_DATE_PARTS = (("yyyy", "%Y"), ("yy", "%y"), ("MMM", "%b"), ("MM", "%m"), ("M", "%m"), ("dd", "%d"), ("d", "%d"))


def read_pulse(path: Path) -> Contents:
    """Read the function of every block; raise DataError if it is cut short or its header states too little."""
    lines, _ = number_lines(read_text(path), 0)
    blocks = _find_pulse_blocks(lines)
    pairs = (line.partition(":") for line in (lines.texts[: blocks[0][0]] if blocks else []))
    header = {key.strip().lower(): value.strip() for key, _, value in pairs if value.strip()}
    if not blocks:
        raise DataError(f"{path}: no rows of numbers. Export the file again.")
    signals, notes = list[Signal](), tuple[str, ...]()
    n = _get_pulse_row_count(path, header)
    if n is None:
        n, notes = blocks[0][1] - blocks[0][0], ("no X-axis size in the header, so missing rows cannot be detected",)
    for record, (first, after) in enumerate(blocks):
        columns = _read_pulse_block(path, lines[first:after], header)
        n_there = min(column.values.size for column in columns)
        if n_there != n:
            place = f"{path}: line {lines.numbers[after - 1]}"
            raise DataError(f"{place}: truncated file, {n_there} of {n} rows. Export the file again.")
        signals += _make_pulse_signals(columns, header, record)
    return Contents(tuple(signals), created=_parse_pulse_date(header), notes=notes)


def _get_pulse_row_count(path: Path, header: Mapping[str, str]) -> int | None:
    """Return the number of rows of a block, None if the header does not state it; DataError if it is no number."""
    stated = header.get("x-axis size")
    if stated is not None and not stated.isdecimal():
        raise DataError(f"{path}: X-axis size {stated!r} is not a number. Export the file again.")
    return None if stated is None else int(stated)


def _read_pulse_block(path: Path, rows: NumberedLines, header: Mapping[str, str]) -> list[Column]:
    """Read the abscissa and the one or two numbers of a value; two also where the header does not state the type."""
    width = len(rows.texts[0].rstrip().split("\t"))
    is_complex = header.get("data type", "complex" if width > 3 else "real").lower() == "complex"
    form = layout.RowLayout("\t", (1, 2, 3) if is_complex else (1, 2))
    return layout.read_columns(rows, form, str(path), header.get("decimal symbol", ""))


def _make_pulse_signals(columns: Sequence[Column], header: Mapping[str, str], record: int) -> Iterator[Signal]:
    axis, *parts = (column.values for column in columns)
    function = np.asarray(parts[0] + 1j * parts[1]) if len(parts) > 1 else parts[0]
    flaws = {i: flaw for column in columns[1:] for i, flaw in column.flaws.items()}
    name, unit = header.get("title", "function"), header.get("amplitudeunit", "")
    over = header.get("x-axis unit", "")
    yield Signal("abscissa", axis, infer_role("", over), over, record=record, flaws=columns[0].flaws)
    yield Signal(name, function, _infer_pulse_role(header, unit), unit, record=record, flaws=flaws)


def _find_pulse_blocks(lines: NumberedLines) -> list[tuple[int, int]]:
    """Return where the rows of each block begin and end."""
    are_rows = [line.lstrip()[:1].isdigit() for line in lines.texts]
    edges = np.flatnonzero(np.diff([0, *are_rows, 0])).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


def _infer_pulse_role(header: Mapping[str, str], unit: str) -> Role:
    function = header.get("function", "").lower()
    if "response" in function:
        return "frf"
    return "coherence" if "coherence" in function else infer_role("", unit) if header.get("x-axis unit") == "s" else ""


def _parse_pulse_date(header: Mapping[str, str]) -> datetime | None:
    """Return date and time of the first block in the local time zone; None if they cannot be read."""
    pattern = header.get("date format", "")
    for part, directive in _PULSE_DATE_PARTS:
        pattern = re.sub(rf"(?<![%\w]){part}(?!\w)", directive, pattern)
    clock = ":".join(header.get("time", "").split(":")[:3])
    return parse_local_time(f"{header.get('date', '')} {clock}", f"{pattern} %H:%M:%S")


def _is_pulse(head: bytes, _path: Path) -> bool:
    return decode_text(head).startswith(PULSE_MAGIC)


def _is_table(head: bytes, _path: Path) -> bool:
    return is_text(head)


_TABLE_EXTENSIONS = (".csv", ".txt", ".frf", ".dat", ".asc")
TEXT_FORMATS = (
    Format("pulse", "B&K PULSE text", (".txt",), _is_pulse, read_pulse),
    Format("table", "text table", _TABLE_EXTENSIONS, _is_table, read_table, read_from=read_table),
)
"""Formats of text; the table is last because it takes any text."""
