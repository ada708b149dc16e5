"""How the rows of a table are written: separator, decimal sign, which of their words are columns of numbers."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.errors import DataError
from acquisition.files.readers.numbered_lines import NumberedLines
from acquisition.files.readers.text import fields

SAMPLE = 200
"""Rows that tell which words are columns."""
FEW = 3
"""Rows below which a word that is no number is no column of words, but a mistake."""
_COMMA_DECIMAL = re.compile(r"\s*[+-]?\d+,\d+([eE][+-]?\d+)?\s*")
_COMMA_NUMBER = re.compile(r"[+-]?\d+(,\d+)?([eE][+-]?\d+)?")
_POSITIVE = r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_PAIR = re.compile(rf"\(\s*([+-]?{_POSITIVE})\s*,\s*([+-]?{_POSITIVE})\s*\)")
_EITHER = _POSITIVE.replace(r"\.", "[.,]")
"""With a decimal point or comma."""
_SUM = re.compile(rf"({_EITHER})\s*([+-])\s*({_EITHER})\s*[ij]\b")
_IMAGINARY = re.compile(r"\(?[^a-df-zA-DF-Z]*[\d.]j\)?")
_TIMESTAMP = re.compile(r"\d{1,4}([-/.:])\d{1,2}\1\d{1,4}")
_MISSING = re.compile(r"#?N/A|#NUM!|#DIV/0!|#VALUE!|[+-]?1[.,]#(IND|INF|QNAN|SNAN)0*", re.IGNORECASE)
"""In place of a number, as spreadsheets and older C libraries write it."""
_NOT_FINITE = {"nan", "inf", "-inf", "+inf"}


@dataclass(frozen=True)
class RowForm:
    """How rows are written."""

    separator: str
    """Pattern between two words of a row."""
    comma: bool
    """Whether the decimal sign is a comma."""
    columns: tuple[int, ...] = ()
    """Which words of a row are numbers, from 0 on."""

    def words(self, line: str) -> list[str]:
        """The words of a line."""
        line = line.strip(" \r\n") if self.separator == "\t" else line.strip()
        if '"' in line and self.separator != r"\s+":
            return fields(line, self.separator)
        return [word.strip().strip('"') for word in re.split(self.separator, line)]

    def number(self, word: str) -> complex:
        """A word as a number, real where it is; ValueError where it is none."""
        plain = word.replace(",", ".") if self.comma else word
        try:
            return float(plain)
        except ValueError:
            if _MISSING.fullmatch(word):
                return math.nan
            return complex(plain) if _IMAGINARY.fullmatch(plain) else float(re.sub("[dD]", "e", plain))

    def is_row(self, line: str) -> bool:
        """Whether a line has a number in each column."""
        words = self.words(line)
        return self.columns[-1] < len(words) and all(self.is_number(words[i]) for i in self.columns)

    def is_number(self, word: str) -> bool:
        """Whether a word is one."""
        try:
            self.number(word)
        except ValueError:
            return False
        return True


def plain_complex(line: str) -> str:
    """A line with its complex numbers, `(1,2)` or `1 + 2i`, as Python writes them."""
    if "(" in line:
        line = _PAIR.sub(lambda match: f"{match[1]}{'' if match[2][0] in '+-' else '+'}{match[2]}j", line)
    return _SUM.sub(r"\1\2\3j", line) if "i" in line or "j" in line else line


def begins_with_number(line: str) -> bool:
    """Whether a line may be a row, by itself."""
    line = plain_complex(line)
    form = dialect([line])
    word, *others = [*filter(None, form.words(line)), ""]
    if _TIMESTAMP.match(word):
        return any(map(form.is_number, others))
    return form.is_number(word) and word.lower() not in _NOT_FINITE


def dialect(rows: Sequence[str]) -> RowForm:
    """How rows are written; the first one with a comma tells what that is."""
    with_comma = next((row for row in rows if "," in row), "")
    for separator in ("\t", ";"):
        if separator in rows[0].strip():
            return RowForm(separator, bool(with_comma))
    words = with_comma.split()
    if len(words) > 1 and all(map(_COMMA_NUMBER.fullmatch, words)):
        return RowForm(r"\s+", comma=True)
    in_quotes = '"' in with_comma and any(map(_COMMA_DECIMAL.fullmatch, fields(with_comma, ",")))
    return RowForm("," if with_comma else r"\s+", in_quotes)


def row_form(rows: Sequence[str]) -> RowForm:
    """How rows are written; the first one may have a heading behind it, and does not tell."""
    form = dialect(rows[1:] or rows)
    sample = [form.words(row) for row in rows[:: max(len(rows) // SAMPLE, 1)]]
    width = max(map(len, sample))
    if len(rows) < FEW:
        return replace(form, columns=tuple(range(len(_trimmed(sample[0])))))
    filled = [sum(i < len(words) and form.is_number(words[i]) for words in sample) for i in range(width)]
    return replace(form, columns=tuple(i for i, count in enumerate(filled) if 2 * count > len(sample)))


def _trimmed(words: Sequence[str]) -> Sequence[str]:
    """Words without an empty one behind the last separator."""
    return words[:-1] if len(words) > 1 and not words[-1] else words


def numbers_of(rows: NumberedLines, form: RowForm, place: str) -> list[NDArray[Any]]:
    """Each column, complex where it is; DataError with the line where a row has others. place: for messages."""
    at_once = _at_once(form, rows.texts)
    if at_once is not None:
        return list(at_once)
    cures = [f"; pass over it with --skip {rows.numbers[0]}, and name the columns with --columns"]
    in_turn = itertools.zip_longest(rows.texts, rows.numbers, cures, fillvalue="")
    one_by_one = [_row(line, form, f"{place}: line {number}", cure) for line, number, cure in in_turn]
    return [column if np.any(column.imag) else column.real for column in np.array(one_by_one).T]


def _at_once(form: RowForm, rows: Sequence[str]) -> NDArray[np.float64] | None:
    """The same where all rows are alike, many times as fast; None where they have to be looked at one by one."""
    if form.separator == r"\s+":
        widths, words = {len(row.split()) for row in rows}, " ".join(rows).split()
    else:
        widths = {row.count(form.separator) + 1 for row in rows}
        words = form.separator.join(rows).split(form.separator)
    if widths != {len(form.columns)}:
        return None
    try:
        values = [*map(float, (word.replace(",", ".") for word in words) if form.comma else words)]
    except ValueError:
        return None
    return np.array(values).reshape(len(rows), len(form.columns)).T


def _row(line: str, form: RowForm, place: str, cure: str) -> list[complex]:
    words, width = form.words(line), len(form.columns)
    behind = words[form.columns[-1] + 1 :]
    if form.columns[-1] >= len(words) or (behind and form.is_number(behind[0])):
        n = sum(map(form.is_number, words))
        if n != width:
            raise DataError(f"{place}: {n} numbers where other rows have {width}{cure}")
    try:
        return [form.number(words[i]) for i in form.columns]
    except (ValueError, IndexError) as error:
        raise DataError(f"{place}: {line.strip()[:60]!r} is no row of numbers{cure}") from error
