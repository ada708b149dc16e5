"""What is wrong in a machine.toml, in words: its place, the value that is refused, what is allowed."""

from __future__ import annotations

import difflib
import re
import typing
from collections.abc import Iterator, Mapping
from typing import Any

from lobewatch.machine.settings.toml_table import Table

NEXT_STEP = {"helix_deg": "give the angle from the axis, 0 up to 90 deg; left-hand flutes cut alike, without a sign"}
"""What to do about a number that lies outside of what its key may hold."""


def readable(message: str, tables: Mapping[str, Any], root: type[Table]) -> str:
    """Message of msgspec on tables of a kind, with its place first and what to write instead."""
    text, _, place = message.partition(" - at `$")
    place = place.rstrip("`")
    where = re.sub(r"\.?(\w+?)s?\[(\d+)\]", lambda m: f" {m[1]} {int(m[2]) + 1}", place).strip(" .")
    unknown, choice = re.search(r"unknown field `(\w+)`", text), re.search(r"Invalid enum value (.+)", text)
    if unknown:
        text = f"unknown key {unknown[1]!r}{_near(unknown[1], _table(place, root).__struct_encode_fields__)}"
    elif choice:
        allowed = _choices(place, root)
        text = f"{choice[1]} is none of {', '.join(map(repr, allowed))}{_near(choice[1], allowed)}"
    elif re.match(r"Expected `\w+` [<>]", text):
        key = re.split(r"\W", place.rstrip("0123456789[]"))[-1]
        text = "; ".join(filter(None, [f"{text}, not {_value(tables, place)}", NEXT_STEP.get(key)]))
    return f"{where.replace('.', ' ')}: {text}" if where else text


def comma_hint(text: str) -> str:
    """Hint at a decimal comma, the usual cause of a text that is no TOML."""
    match = re.search(r"=\s*(-?\d+),(\d+)\s*(#|\n|,|\})", text)
    return f"; write {match[1]}.{match[2]} with a point" if match else ""


def _near(word: str, words: typing.Sequence[str]) -> str:
    near = difflib.get_close_matches(word.strip("'"), words, n=1)
    return f"; is {near[0]!r} meant?" if near else ""


def _table(place: str, root: type[Table]) -> type[Table]:
    """Kind of the table at a place like ".program[0]"."""
    table = root
    for key in re.findall(r"\.(\w+)", place):
        table = next(kind for kind in _kinds(_hint(table, key)) if isinstance(kind, type) and issubclass(kind, Table))
    return table


def _choices(place: str, root: type[Table]) -> list[str]:
    """Words that may stand at a place like ".program[0].wear"."""
    parent, _, key = place.rpartition(".")
    return [kind for kind in _kinds(_hint(_table(parent, root), key)) if isinstance(kind, str)]


def _hint(table: type[Table], key: str) -> object:
    own = dict(zip(table.__struct_encode_fields__, table.__struct_fields__, strict=True))[key]
    return typing.get_type_hints(table, include_extras=True)[own]


def _kinds(kind: object) -> Iterator[object]:
    """All that a type is made of, itself first."""
    yield kind
    for part in typing.get_args(kind):
        yield from _kinds(part)


def _value(tables: Mapping[str, Any], place: str) -> object:
    """Value at a place like ".program[0].depth_mm"."""
    value: Any = tables
    for key, number in re.findall(r"\.(\w+)|\[(\d+)\]", place):
        value = value[key] if key else value[int(number)]
    return value
