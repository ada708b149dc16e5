"""Base class, number types and readable errors of the tables of machine.toml."""

from __future__ import annotations

import difflib
import re
import typing
from collections.abc import Iterator, Mapping
from typing import Annotated, Any

from msgspec import Meta, Struct

from acquisition import check_name

Positive = Annotated[float, Meta(gt=0, le=1e12)]
NotNegative = Annotated[float, Meta(ge=0, le=1e12)]
PositiveOrInfinite = Annotated[float, Meta(gt=0)]
"""Positive number; infinite for "rigid" or "no limit"."""


class TomlTable(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Table of machine.toml that refuses unknown keys."""


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


RANGE_ERROR_HINTS = {
    "helix_deg": "give the angle from the axis, 0 up to 90 deg; left-hand flutes cut alike, without a sign"
}
"""Remedy for a number outside the range of its key."""


def explain_validation_error(message: str, tables: Mapping[str, Any], root: type[TomlTable]) -> str:
    """Rewrite a msgspec validation error with its place first and with what to write instead."""
    text, _, place = message.partition(" - at `$")
    place = place.rstrip("`")
    where = re.sub(r"\.?(\w+?)s?\[(\d+)\]", lambda m: f" {m[1]} {int(m[2]) + 1}", place).strip(" .")
    unknown, choice = re.search(r"unknown field `(\w+)`", text), re.search(r"Invalid enum value (.+)", text)
    if unknown:
        keys = _find_table_type(place, root).__struct_encode_fields__
        text = f"unknown key {unknown[1]!r}{_suggest_spelling(unknown[1], keys)}"
    elif choice:
        allowed = _list_choices(place, root)
        text = f"{choice[1]} is none of {', '.join(map(repr, allowed))}{_suggest_spelling(choice[1], allowed)}"
    elif re.match(r"Expected `\w+` [<>]", text):
        key = re.split(r"\W", place.rstrip("0123456789[]"))[-1]
        text = "; ".join(filter(None, [f"{text}, not {_find_value(tables, place)}", RANGE_ERROR_HINTS.get(key)]))
    return f"{where.replace('.', ' ')}: {text}" if where else text


def suggest_decimal_point(text: str) -> str:
    """Return a hint at a decimal comma, the usual cause of invalid TOML; empty without one."""
    match = re.search(r"=\s*(-?\d+),(\d+)\s*(#|\n|,|\})", text)
    return f"; write {match[1]}.{match[2]} with a point" if match else ""


def _suggest_spelling(word: str, words: typing.Sequence[str]) -> str:
    near = difflib.get_close_matches(word.strip("'"), words, n=1)
    return f"; is {near[0]!r} meant?" if near else ""


def _find_table_type(place: str, root: type[TomlTable]) -> type[TomlTable]:
    """Return the type of the table at a place like ".program[0]"."""
    table = root
    for key in re.findall(r"\.(\w+)", place):
        kinds = (kind for kind in _iterate_types(_find_field_type(table, key)) if isinstance(kind, type))
        table = next(kind for kind in kinds if issubclass(kind, TomlTable))
    return table


def _list_choices(place: str, root: type[TomlTable]) -> list[str]:
    """Return the allowed words at a place like ".program[0].wear"."""
    parent, _, key = place.rpartition(".")
    kinds = _iterate_types(_find_field_type(_find_table_type(parent, root), key))
    return [kind for kind in kinds if isinstance(kind, str)]


def _find_field_type(table: type[TomlTable], key: str) -> object:
    own = dict(zip(table.__struct_encode_fields__, table.__struct_fields__, strict=True))[key]
    return typing.get_type_hints(table, include_extras=True)[own]


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
