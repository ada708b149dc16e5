"""What stands above the rows of a table, or behind the first of them: names and units of its columns."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from acquisition.files.contents.heading import is_unit, name_and_unit, role_of
from acquisition.files.contents.units import unit_of
from acquisition.files.readers.numerals import is_number
from acquisition.files.readers.row_form import BLANKS, RowForm
from acquisition.files.readers.text import fields

Heading = list[tuple[str, str]]
"""Name and unit of each column; empty where they are not said."""
_RATIO = "Units: Ratio"
_PRODUCT = re.compile(r"(\(.+\))(\(.+\))")
_LETTER = re.compile(r"[^\W\d_]")
_UNIT_LABEL = re.compile(r"unit|einheit|unidad|単位|单位", re.IGNORECASE)
"""At the begin of a line of units."""
_MARK = re.compile(r"^\s*[#%!*/]+\s*")
"""Of a comment."""
_UNTIL_BRACKET = re.compile(r"\s+(?=[\[(])")


def heading_above(lines: Sequence[str], form: RowForm, width: int) -> Heading:
    """From the line with a word for each column of which most are known, the nearest of several; its units from a line
    of units. Empty where no line has so many words.

    width: words of a row.
    """
    lines = [_MARK.sub("", line) for line in lines]
    by_line = [words for line in reversed(lines) if (words := _words(line, form, width))]
    units = next((words for words in by_line if _are_units(words)), [])
    named = [words for words in by_line if any(map(_LETTER.search, words)) and not any(map(is_number, words))]
    names = [words for words in named if words is not units] or [[""] * len(units)]
    in_turn = _words(lines[-1], replace(form, columns=tuple(range(2 * len(form.columns)))), 0) if lines else []
    if in_turn and all(in_turn[::2]) and is_unit(in_turn[1]):
        return _alternating(in_turn)
    return _paired(max(names, key=_known), units, is_ratio=_RATIO in lines)


def _known(words: Sequence[str]) -> int:
    """How many tell what their column is."""
    return sum(bool(role_of(*name_and_unit(word))) for word in words)


def heading_behind(row: str, form: RowForm) -> Heading:
    """Behind the numbers of a row: a name and a unit for each column, or names alone; else empty."""
    width = len(form.columns)
    words = re.split(r"\s+" if form.separator in (BLANKS, "\t") else form.separator, row.strip(), maxsplit=width)
    if len(words) <= width or not all(map(is_number, words[:width])) or is_number((words[width].split() or [""])[0]):
        return []
    names = [word for word in re.split(r"\s*\t\s*|\s*;\s*|\s+", words[width].strip()) if word]
    if len(names) == 2 * width:
        return _alternating(names)
    return [name_and_unit(name) for name in names] if len(names) == width else []


def _alternating(words: Sequence[str]) -> Heading:
    """Of a name and a unit for each column in turn."""
    return [(name, unit if is_unit(unit) else "") for name, unit in zip(words[::2], words[1::2], strict=True)]


def is_unit_line(lines: Sequence[str], form: RowForm, width: int) -> bool:
    """Whether the last of these lines is one of units."""
    return bool(lines) and _are_units(_words(lines[-1], form, width))


def _words(line: str, form: RowForm, width: int) -> list[str]:
    """A word for each column, whatever separates them; empty where there are more or fewer."""
    joined = _UNTIL_BRACKET.sub("", line)
    for separator in (form.separator, "\t", ";", ",", "[ \t]{2,}", BLANKS):
        text = line if separator in ",;\t" else joined
        words = [word.strip() for word in _split(text.strip(" \r\n"), separator)]
        if len(words) == width:
            return [words[i] for i in form.columns]
        while len(words) > len(form.columns) and not words[-1]:
            words.pop()
        if len(words) == len(form.columns):
            return words
    return []


def _split(line: str, separator: str) -> list[str]:
    if separator in ",;\t":
        return fields(line, separator)
    return re.split(separator, line.strip())


def _are_units(words: Sequence[str]) -> bool:
    """Whether all are units; or the first is one of time or frequency and no other a name that is known."""
    bare = [word.strip("()[] ") for word in words if not _UNIT_LABEL.match(word)]
    if not any(bare):
        return False
    if all(not word or word == "-" or is_unit(word) for word in bare):
        return True
    first = unit_of(bare[0])
    return first is not None and first.quantity in ("time", "frequency") and not any(role_of(word, "") for word in bare)


def _paired(names: Sequence[str], units: Sequence[str], *, is_ratio: bool) -> Heading:
    """is_ratio: whether a product of units is meant as a ratio."""
    if not units:
        return [name_and_unit(name) for name in names]
    said = ["" if _UNIT_LABEL.match(word) else word for word in units]
    bare = [word.strip("()[] ") if unit_of(word) is None else word for word in said]
    texts = [_PRODUCT.sub(r"\1/\2", unit) if is_ratio else unit for unit in bare]
    return [(name, text.strip("-")) for name, text in zip(names, texts, strict=True)]
