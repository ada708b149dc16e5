"""What is wrong in machine.toml, said so that it can be put right: place, value, and the key that may be meant."""

from __future__ import annotations

import difflib
import re
from collections.abc import Collection, Mapping
from typing import Any


def comma_hint(text: str) -> str:
    """A decimal comma is the usual cause of a text that is no TOML."""
    match = re.search(r"=\s*(-?\d+),(\d+)\s*(#|\n|,|\})", text)
    return f"; write {match[1]}.{match[2]} with a point" if match else ""


def readable(message: str, tables: Mapping[str, Any], known: Collection[str]) -> str:
    """The message of msgspec with its place first, the value that is refused, and a known key for a mistyped one."""
    text, _, place = message.partition(" - at `$")
    place = place.rstrip("`")
    where = re.sub(r"\.?(\w+?)s?\[(\d+)\]", lambda m: f" {m[1]} {int(m[2]) + 1}", place).strip(" .")
    unknown = re.search(r"unknown field `(\w+)`", text)
    if unknown:
        near = difflib.get_close_matches(unknown[1], known, n=1)
        text = f"unknown key {unknown[1]!r}" + (f"; is {near[0]!r} meant?" if near else "")
    elif re.match(r"Expected `\w+` [<>]", text):
        text += f", not {_value(tables, place)}"
    return f"{where.replace('.', ' ')}: {text}" if where else text


def _value(tables: Mapping[str, Any], place: str) -> object:
    """What stands at a place like ".program[0].depth_mm"."""
    found: Any = tables
    for key, number in re.findall(r"\.(\w+)|\[(\d+)\]", place):
        found = found[key] if key else found[int(number)]
    return found
