"""Text and tables of machine.toml: read, parse, check and edit."""

import contextlib
import copy
import difflib
import json
import os
import re
import tomllib
import typing
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from itertools import chain, zip_longest
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from msgspec import Meta, Struct

from acquisition import DataError, check_name
from acquisition.errors import join_sentences
from acquisition.file_io import atomic_write, read_regular_file
from lobewatch.machine.settings.number_text import SEPARATED_NUMBER_PATTERN, format_number, list_readings

Positive = Annotated[float, Meta(gt=0, le=1e12)]
NotNegative = Annotated[float, Meta(ge=0, le=1e12)]
PositiveOrInfinite = Annotated[float, Meta(gt=0)]
"""Positive number; infinite for "rigid" or "no limit"."""


class Plausible(NamedTuple):
    """Plausible range of a number in the unit of its key; 0 and infinity stand for "none" and raise no question.

    All ranges are chosen: common shop values with a margin, and less than a factor of 1000 wide if possible, so that
    a value wrong by 1000 is outside. docs/plausible.md lists the mistakes that they cannot detect.
    """

    low: float
    """Smallest plausible number."""
    high: float
    """Largest plausible number."""


class TomlTable(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Table of machine.toml that rejects unknown keys."""


def check_control_characters(table: Mapping[str, Any], place: str = "") -> None:
    """Raise ValueError with its place for the first text that contains a control character."""
    for key, value in table.items():
        if isinstance(value, str):
            check_name(value, f"{place}{key}")
        elif isinstance(value, Mapping):
            check_control_characters(value, f"{place}{key}: ")
        elif isinstance(value, list):
            for i, inner in enumerate(value, 1):
                if isinstance(inner, Mapping):
                    check_control_characters(inner, f"{place}{key.removesuffix('s')} {i}: ")


HELIX_HINT = "Give the helix angle from the axis, 0 to below 90 deg, also for left-hand flutes"
"""Remedy for a helix angle outside its range."""
TYPE_NAMES = {"int": "a whole number", "float": "a number", "str": "a text", "bool": "true or false"}
TYPE_NAMES |= {"array": "a list", "object": "a table", "date": "a date"}
"""Plain names of the types in msgspec errors."""


def explain_validation_error(message: str, tables: Mapping[str, Any], root: type[TomlTable]) -> str:
    """Rewrite a msgspec validation error with its place first and with its remedy."""
    text, _, place = message.partition(" - at `$")
    place, hints = place.rstrip("`"), [""]
    where = re.sub(r"\.?(\w+?)s?\[(\d+)\]", lambda m: f" {m[1]} {int(m[2]) + 1}", place).strip(" .")
    unknown, choice = re.search(r"unknown field `(\w+)`", text), re.search(r"Invalid enum value (.+)", text)
    if unknown:
        keys = _find_table_type(place, root).__struct_encode_fields__
        text, hints = f"unknown key {unknown[1]!r}", [suggest_spelling(unknown[1], keys)]
    elif choice:
        parent, _, key = place.rpartition(".")
        kinds = _iterate_types(_find_field_type(_find_table_type(parent, root), key))
        allowed = [kind for kind in kinds if isinstance(kind, str)]
        text = f"unknown value {choice[1]}"
        hints = [f"Allowed: {', '.join(map(repr, allowed))}", suggest_spelling(choice[1], allowed)]
    elif re.match(r"Expected `\w+` [<>]", text):
        hints = [HELIX_HINT if place.endswith(".helix_deg") else ""]
        text = f"{text}, not {_find_value(tables, place)}"
    text = join_sentences(_name_types(text), *hints)
    return f"{where.replace('.', ' ')}: {text}" if where else text


def _name_types(text: str) -> str:
    """Rewrite the types and the missing key of a msgspec error in plain words."""
    text = re.sub(r"^Object missing required field `(\w+)`", r"missing key '\1'", text)
    text = re.sub("^Expected", "expected", text)
    return re.sub(r"`([a-z |]+)`", _join_type_names, text)


def _join_type_names(match: re.Match[str]) -> str:
    return " or ".join(TYPE_NAMES.get(kind, kind) for kind in match[1].split(" | ") if kind != "null")


def suggest_plain_number(text: str) -> str:
    """Return the remedy for a decimal comma or for separated thousands in invalid TOML; empty without one."""
    for match in re.finditer(rf"=\s*([+-]?{SEPARATED_NUMBER_PATTERN})\s*(?:#|\n|,|\}}|$)", text):
        readings = list_readings(match[1])
        if readings and not re.fullmatch(r"[\d.+-]+", match[1]):
            return f"Write {' or '.join(map(format_number, readings))} in TOML"
    return ""


def suggest_spelling(word: str, words: Iterable[str]) -> str:
    """Return a question with the nearest of some words; empty without one."""
    near = difflib.get_close_matches(word.strip("'"), list(words), n=1)
    return f"Did you mean {near[0]!r}?" if near else ""


def _find_table_type(place: str, root: type[TomlTable]) -> type[TomlTable]:
    """Return the type of the table at a place like ".program[0]"."""
    table = root
    for key in re.findall(r"\.(\w+)", place):
        kinds = (kind for kind in _iterate_types(_find_field_type(table, key)) if isinstance(kind, type))
        table = next(kind for kind in kinds if issubclass(kind, TomlTable))
    return table


def _find_field_type(table: type[TomlTable], key: str) -> object:
    own = dict(zip(table.__struct_encode_fields__, table.__struct_fields__, strict=True))[key]
    return typing.get_type_hints(table, include_extras=True)[own]


@cache
def find_plausible_ranges(table: type[TomlTable]) -> dict[str, Plausible]:
    """Return the plausible ranges of a table by key."""
    hints = typing.get_type_hints(table, include_extras=True).items()
    return {key: part for key, kind in hints for part in _iterate_types(kind) if isinstance(part, Plausible)}


def _iterate_types(kind: object) -> Iterator[object]:
    """Yield a type and all types that it consists of."""
    yield kind
    for part in typing.get_args(kind):
        yield from _iterate_types(part)


def _find_value(tables: Mapping[str, Any], place: str) -> object:
    """Return the value at a place like ".program[0].depth_mm"."""
    value: Any = tables
    for key, number in re.findall(r"\.(\w+)|\[(\d+)\]", place):
        value = value[key] if key else value[int(number)]
    return value


MAX_TOML_BYTES = 200_000
"""Largest size of machine.toml (bytes); chosen, ten times that of a busy machine."""
DOTTED_KEY_PATTERN = re.compile(r"""(?:(?:(?<![\w-])[\w-]++|"[^"\n]*"|'[^'\n]*')\s*+\.\s*+){20}""")
"""Key with too many parts, whose parsing time grows with the square of their number."""


LINE_END_PATTERN = re.compile(r"\r\n|\r|\n")
"""Line ends of Windows, of old Macs and of Unix."""


def read_toml_text(path: Path) -> str:
    """Read the text of a machine file with unified line ends and without a byte order mark.

    Raises DataError for invalid UTF-8, OSError for a file that is too large or cannot be read.
    """
    return LINE_END_PATTERN.sub("\n", _read_text(path).removeprefix("\ufeff"))


def _read_text(path: Path) -> str:
    try:
        return read_regular_file(path, MAX_TOML_BYTES).decode("utf-8")
    except UnicodeDecodeError as error:
        raise DataError(f"{path}: invalid UTF-8 at byte {error.start}. Save the file as UTF-8.") from error


def write_toml_text(path: Path, text: str) -> None:
    """Write the text of a machine file, through a link to its target.

    An existing file keeps its mode, its byte order mark and its line ends. A new line gets the first line end.
    """
    target = Path(os.path.realpath(path)) if path.is_symlink() else path
    old = _read_text(target) if target.exists() else ""
    mark = "\ufeff" if old.startswith("\ufeff") else ""
    atomic_write(target, (mark + _restore_line_ends(text, old.removeprefix("\ufeff"))).encode())


def _restore_line_ends(text: str, old: str) -> str:
    """Return a text whose unchanged lines have the line ends of the old text, and the others its first line end."""
    ends, lines = LINE_END_PATTERN.findall(old), text.split("\n")
    new_ends = [*ends, "\n"][:1] * len(lines)
    if len(set(ends)) > 1:
        matcher = difflib.SequenceMatcher(None, LINE_END_PATTERN.split(old), lines, autojunk=False)
        for _, begin, end, place, _ in matcher.get_opcodes():
            kept = ends[begin:end]
            new_ends[place : place + len(kept)] = kept
    return "".join(chain.from_iterable(zip_longest(lines, new_ends[: len(lines) - 1], fillvalue="")))


def parse_toml_tables(text: str) -> dict[str, Any]:
    """Parse the tables of a machine file; tomllib.TOMLDecodeError for invalid TOML, ValueError for deep nesting."""
    dotted = DOTTED_KEY_PATTERN.search(text)
    try:
        if dotted is not None:
            raise RecursionError
        return tomllib.loads(text)
    except RecursionError as error:
        line = "" if dotted is None else f" in line {text.count(chr(10), 0, dotted.start()) + 1}"
        raise ValueError(
            f"tables or lists are nested too deeply{line}. machine.toml needs at most four levels."
        ) from error


class KeyConflict(NamedTuple):
    """Key that somebody else changed after a person saw its value."""

    key: str
    """Place of the key, such as "program 'A' depth_mm"."""
    present: Any
    """Value in the file, None without one."""
    wanted: Any
    """Value to write, None to remove the key."""

    def __str__(self) -> str:
        present, wanted = ("nothing" if value is None else repr(value) for value in self[1:])
        return f"{self.key} is now {present} in the file, and {wanted} in your answer"


def find_key_conflicts(seen: str, present: str, wanted: str) -> list[KeyConflict]:
    """Return the keys that differ in the text that a person has seen, in the present text and in the wanted text."""
    old, now, new = (dict(_list_values(parse_toml_tables(text))) for text in (seen, present, wanted))
    keys = [key for key in now | new if now.get(key) not in (old.get(key), new.get(key))]
    return [KeyConflict(key, now.get(key), new.get(key)) for key in keys]


def _list_values(table: Mapping[str, Any], place: str = "") -> Iterator[tuple[str, Any]]:
    """Yield all values of tables with their places. Tables of a list are told apart by their name or quantity."""
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from _list_values(value, f"{place}{key} ")
        elif isinstance(value, list) and value and isinstance(value[0], Mapping):
            names = [str(inner.get("name", inner.get("quantity", ""))) for inner in value]
            for number, (name, inner) in enumerate(zip(names, value, strict=True)):
                yield from _list_values(inner, f"{place}{key} {name!r}{' again' * names[:number].count(name)} ")
        else:
            yield f"{place}{key}", value


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
    raise DataError(
        f"machine.toml: [{place.name}] has a layout that lobewatch cannot edit. Edit this table in a text editor."
    )


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
    places.sort(key=lambda entry: entry[1][1] is not None)  # a comment counts if the key is nowhere else
    if value is None:
        if places and places[0][1][1] is None:
            lines[places[0][0]] = f"# {lines[places[0][0]]}"
        return 0
    if isinstance(value, float) and value.is_integer() and abs(value) < 1e15:
        value = int(value)
    content = f"{key} = {json.dumps(value, ensure_ascii=False)}"  # texts, numbers and words of TOML are those of JSON
    if not places:
        keys = (i for i in range(start, end) if re.match(r"[\w\"'. -]+=", lines[i]))
        lines.insert(max(keys, default=start - 1) + 1, content)
        return 1
    number, match = places[0]
    comment = (match[3] or "").strip()
    column = lines[number].rindex(comment) if comment else 0
    lines[number] = f"{content.ljust(column - 1)} {comment}" if comment else content
    return 0
