"""Read, parse and edit the text of machine.toml."""

from __future__ import annotations

import contextlib
import copy
import json
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from acquisition import DataError
from acquisition.file_io import read_regular_file

MAX_TOML_BYTES = 200_000
"""Largest size of machine.toml (bytes); chosen, ten times that of a busy machine."""
DOTTED_KEY_PATTERN = re.compile(r"""(?:(?:(?<![\w-])[\w-]++|"[^"\n]*"|'[^'\n]*')\s*+\.\s*+){20}""")
"""Key with too many parts, whose parsing time grows with the square of their number."""


def read_toml_text(path: Path) -> str:
    """Read the text of a machine file with unified line ends.

    Raises DataError for invalid UTF-8, OSError for a file that is too large or cannot be read.
    """
    try:
        return read_regular_file(path, MAX_TOML_BYTES).decode("utf-8").replace("\r\n", "\n").replace("\r", "\n")
    except UnicodeDecodeError as error:
        raise DataError(f"{path}: no UTF-8 text at byte {error.start}; save it as UTF-8") from error


def parse_toml_tables(text: str) -> dict[str, Any]:
    """Parse the tables of a machine file; tomllib.TOMLDecodeError for invalid TOML, ValueError for deep nesting."""
    dotted = DOTTED_KEY_PATTERN.search(text)
    try:
        if dotted is not None:
            raise RecursionError
        return tomllib.loads(text)
    except RecursionError as error:
        line = "" if dotted is None else f" in line {text.count(chr(10), 0, dotted.start()) + 1}"
        raise ValueError(f"tables or arrays are nested too deep{line}; machine.toml needs four levels") from error


TomlValue = str | bool | int | float | list[str] | None
"""Value of a key; None removes the key."""
TABLE_HEADER_PATTERN = re.compile(r"(# )?\[(\[?)([\w.]+)\]?\][ \t]*(#.*)?$")
"""Line that begins a table, or a commented-out one."""
TOML_VALUE_PATTERN = r"(?:\"(?:[^\"\\]|\\.)*\"|'[^']*'|\[(?:[^\]\"]|\"(?:[^\"\\]|\\.)*\")*\]|[^#]*?)"
"""Value on one line."""


class TablePath(NamedTuple):
    """Address of a table in machine.toml."""

    name: str
    """Name in its header."""
    number: int | None = None
    """Index in an array of tables; None for a single table."""


def edit_toml(text: str, place: TablePath, values: Mapping[str, TomlValue]) -> str:
    """Set values of a table in the text of a machine file; a commented-out key or table is used first.

    An index one above the last adds a table to its array. Raises DataError for a text that this editor cannot change.
    """
    wanted = _set_values(parse_toml_tables(text), place, values)
    lines = text.split("\n")
    start, end = _locate_table(lines, place)
    for key, value in values.items():
        end += _edit_line(lines, start, end, key, value)
    edited = "\n".join(lines)
    with contextlib.suppress(tomllib.TOMLDecodeError):
        if tomllib.loads(edited) == wanted:
            return edited
    raise DataError(f"machine.toml: [{place.name}] is written in a way that only a person can edit; edit it by hand")


def _set_values(tables: dict[str, Any], place: TablePath, values: Mapping[str, TomlValue]) -> dict[str, Any]:
    """Return the tables with the new values."""
    wanted = copy.deepcopy(tables)
    *parents, last = place.name.split(".")
    table: dict[str, Any] = wanted
    for parent in parents:
        table = table.setdefault(parent, {})
    if place.number is None:
        table = table.setdefault(last, {})
    else:
        listed = table.setdefault(last, [])
        if place.number == len(listed):
            listed.append({})
        table = listed[place.number]
    for key, value in values.items():
        table.pop(key, None)
        if value is not None:
            table[key] = value
    return wanted


def _locate_table(lines: list[str], place: TablePath) -> tuple[int, int]:
    """Return the line range of a table, adding the table if necessary."""
    headers = [(i, match) for i, line in enumerate(lines) if (match := TABLE_HEADER_PATTERN.match(line))]
    is_array = place.number is not None
    named = [(i, match) for i, match in headers if match[3] == place.name and bool(match[2]) == is_array]
    active = [i for i, match in named if not match[1]]
    number = place.number or 0
    if number < len(active):
        start = active[number]
    elif commented := [i for i, match in named if match[1] and i > max(active, default=-1)]:
        start = commented[0]
        lines[start] = lines[start].removeprefix("# ")
    else:
        start = _append_table(lines, place, active)
    after = [i for i, _ in headers if i > start]
    return start + 1, min(after, default=len(lines))


def _append_table(lines: list[str], place: TablePath, active: list[int]) -> int:
    """Add a header after the last table of its array or at the end of the text, and return its line."""
    headers = [i for i, line in enumerate(lines) if TABLE_HEADER_PATTERN.match(line) and active and i > active[-1]]
    at = min(headers, default=len(lines))
    while at > 0 and (not lines[at - 1].strip() or (active and lines[at - 1].startswith("#"))):
        at -= 1
    header = f"[{place.name}]" if place.number is None else f"[[{place.name}]]"
    lines[at:at] = ["", header] if at == len(lines) or not lines[at].strip() else ["", header, ""]
    return at + 1


def _edit_line(lines: list[str], start: int, end: int, key: str, value: TomlValue) -> int:
    """Set a key within a range of lines, and return the number of added lines."""
    key_line = re.compile(rf"(# ?)?{re.escape(key)}[ \t]*=[ \t]*({TOML_VALUE_PATTERN})([ \t]*#.*)?$")
    places = [(i, match) for i in range(start, end) if (match := key_line.match(lines[i]))]
    places.sort(key=lambda entry: entry[1][1] is not None)  # a comment counts where the key stands nowhere
    if value is None:
        if places and places[0][1][1] is None:
            lines[places[0][0]] = f"# {lines[places[0][0]]}"
        return 0
    content = f"{key} = {_format_toml_value(value)}"
    if not places:
        lines.insert(_find_last_key(lines, start, end) + 1, content)
        return 1
    number, match = places[0]
    comment = (match[3] or "").strip()
    column = lines[number].rindex(comment) if comment else 0
    lines[number] = f"{content.ljust(column - 1)} {comment}" if comment else content
    return 0


def _find_last_key(lines: list[str], start: int, end: int) -> int:
    """Return the last line of a range that sets a key, or the header line."""
    return max((i for i in range(start, end) if re.match(r"[\w\"'. -]+=", lines[i])), default=start - 1)


def _format_toml_value(value: TomlValue) -> str:
    if isinstance(value, float) and value.is_integer() and abs(value) < 1e15:
        return str(int(value))
    return json.dumps(value, ensure_ascii=False)  # texts, numbers and words of TOML are those of JSON
