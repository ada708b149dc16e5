"""Read, parse and edit the text of machine.toml."""

from __future__ import annotations

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
"""Bytes of a machine.toml; chosen, some ten times that of a busy machine."""
DOTTED_KEY_PATTERN = re.compile(r"""(?:(?:(?<![\w-])[\w-]++|"[^"\n]*"|'[^'\n]*')\s*+\.\s*+){20}""")
"""A key of more parts than any has; reading takes their number squared."""


def read_toml_text(path: Path) -> str:
    """Text of a machine file, its line ends as one character; DataError where it is no UTF-8, OSError where it is no
    file, larger than any should be, or cannot be read."""
    try:
        return read_regular_file(path, MAX_TOML_BYTES).decode("utf-8").replace("\r\n", "\n").replace("\r", "\n")
    except UnicodeDecodeError as error:
        raise DataError(f"{path}: no UTF-8 text at byte {error.start}; save it as UTF-8") from error


def parse_toml_tables(text: str) -> dict[str, Any]:
    """Tables of a machine file; tomllib.TOMLDecodeError where it is none, ValueError where they are nested too deep."""
    dotted = DOTTED_KEY_PATTERN.search(text)
    try:
        if dotted is not None:
            raise RecursionError
        return tomllib.loads(text)
    except RecursionError as error:
        line = "" if dotted is None else f" in line {text.count(chr(10), 0, dotted.start()) + 1}"
        raise ValueError(f"tables or arrays are nested too deep{line}; machine.toml needs four levels") from error


TomlValue = str | bool | int | float | list[str] | None
"""Value of a key; None takes the key out."""
TABLE_HEADER_PATTERN = re.compile(r"(# )?\[(\[?)([\w.]+)\]?\][ \t]*(#.*)?$")
"""Line that begins a table, or would if it were no comment."""
TOML_VALUE_PATTERN = r"(?:\"(?:[^\"\\]|\\.)*\"|'[^']*'|\[(?:[^\]\"]|\"(?:[^\"\\]|\\.)*\")*\]|[^#]*?)"
"""Value in one line."""


class TablePath(NamedTuple):
    """Table of machine.toml."""

    name: str
    """Name as in its header."""
    number: int | None = None
    """Number in a list of tables, from 0; None where there is one such table alone."""


def edit_toml(text: str, place: TablePath, values: Mapping[str, TomlValue]) -> str:
    """Text with these values in a table; a key or table that stands there as a comment takes the place of it.

    A number one above those of the list adds a table to it. DataError where the text is written in a way that this
    cannot edit.
    """
    wanted = _set_values(parse_toml_tables(text), place, values)
    lines = text.split("\n")
    start, end = _locate_table(lines, place)
    for key, value in values.items():
        end += _edit_line(lines, start, end, key, value)
    edited = "\n".join(lines)
    try:
        if tomllib.loads(edited) == wanted:
            return edited
    except tomllib.TOMLDecodeError:
        pass
    raise DataError(f"machine.toml: [{place.name}] is written in a way that only a person can edit; edit it by hand")


def _set_values(tables: dict[str, Any], place: TablePath, values: Mapping[str, TomlValue]) -> dict[str, Any]:
    """Tables as they are meant to be."""
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
    """First and last but one line of a table, which is made where there is none."""
    headers = [(i, match) for i, line in enumerate(lines) if (match := TABLE_HEADER_PATTERN.match(line))]
    named = [
        (i, match) for i, match in headers if match[3] == place.name and bool(match[2]) == (place.number is not None)
    ]
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
    """Header behind the last table of its list, or at the end of the text."""
    headers = [i for i, line in enumerate(lines) if TABLE_HEADER_PATTERN.match(line) and active and i > active[-1]]
    at = min(headers, default=len(lines))
    while at > 0 and (not lines[at - 1].strip() or (active and lines[at - 1].startswith("#"))):
        at -= 1
    header = f"[{place.name}]" if place.number is None else f"[[{place.name}]]"
    lines[at:at] = ["", header] if at == len(lines) or not lines[at].strip() else ["", header, ""]
    return at + 1


def _edit_line(lines: list[str], start: int, end: int, key: str, value: TomlValue) -> int:
    """Line of a key in a stretch of lines; the number of lines that are added."""
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
    """Last line of a stretch that sets a key; its header where none does."""
    return max((i for i in range(start, end) if re.match(r"[\w\"'. -]+=", lines[i])), default=start - 1)


def _format_toml_value(value: TomlValue) -> str:
    if isinstance(value, float) and value.is_integer() and abs(value) < 1e15:
        return str(int(value))
    return json.dumps(value, ensure_ascii=False)  # texts, numbers and words of TOML are those of JSON
