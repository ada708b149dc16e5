"""How the rows of a table are written: separator, numerals, which of their words are columns of numbers."""

from __future__ import annotations

import itertools
import re
import statistics
from collections.abc import Sequence
from dataclasses import dataclass, replace

from acquisition.errors import DataError
from acquisition.files.readers.numbered_lines import NumberedLines
from acquisition.files.readers.numerals import Column, is_number, read_columns
from acquisition.files.readers.text import fields

SAMPLE = 200
"""Rows that tell which words are columns."""
FEW = 3
"""Rows below which a word that is no number is no column of words, but a mistake."""
SOME = 8
"""Rows, at least, of a column that ends before half of the table, as a hit has no fewer samples and notes have; and of
those at the end that stop before the last column, as fewer may have lost a number."""
BLANKS = "[ \t]+"
"""Separator of words that stand apart by blanks: none of them can be empty. Others stand within numbers."""
_POSITIVE = r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_PAIR = re.compile(rf"\(\s*([+-]?{_POSITIVE})\s*,\s*([+-]?{_POSITIVE})\s*\)")
_EITHER = _POSITIVE.replace(r"\.", "[.,]")
"""With a decimal point or comma."""
_SUM = re.compile(rf"({_EITHER})\s*([+-])\s*({_EITHER})\s*[ij]\b")
_TIMESTAMP = re.compile(r"\d{1,4}([-/.:])\d{1,2}\1\d{1,4}")
_NOT_FINITE = {"nan", "inf", "-inf", "+inf"}


@dataclass(frozen=True)
class RowForm:
    """How rows are written."""

    separator: str
    """Pattern between two words of a row."""
    columns: tuple[int, ...] = ()
    """Which words of a row are numbers, from 0 on."""

    def words(self, line: str) -> list[str]:
        """The words of a line."""
        line = line.strip(" \r\n") if self.separator == "\t" else line.strip()
        if '"' in line and self.separator != BLANKS:
            return fields(line, self.separator)
        return [word.strip().strip('"') for word in re.split(self.separator, line)]


def plain_complex(line: str) -> str:
    """A line with its complex numbers, `(1,2)` or `1 + 2i`, as Python writes them."""
    if "(" in line:
        line = _PAIR.sub(lambda match: f"{match[1]}{'' if match[2][0] in '+-' else '+'}{match[2]}j", line)
    return _SUM.sub(r"\1\2\3j", line) if "i" in line or "j" in line else line


def begins_with_number(line: str) -> bool:
    """Whether a line may be a row, by itself."""
    line = plain_complex(line)
    word, *others = [*filter(None, dialect([line]).words(line)), ""]
    if _TIMESTAMP.match(word):
        return any(map(is_number, others))
    return is_number(word) and word.lower() not in _NOT_FINITE


def dialect(rows: Sequence[str]) -> RowForm:
    """What separates the words of rows; the first one with a comma tells what that is."""
    for separator in ("\t", ";"):
        if separator in rows[0].strip():
            return RowForm(separator)
    with_comma = next((row for row in rows if "," in row), "")
    words = re.split(BLANKS, with_comma.strip())
    may_be_blanks = not with_comma or (len(words) > 1 and all(map(_is_whole, words)))
    return RowForm(BLANKS if may_be_blanks else ",")


def _is_whole(word: str) -> bool:
    """Whether it is one number, and no part of a row between commas."""
    return is_number(word) and not word.endswith(",")


def row_form(rows: Sequence[str]) -> RowForm:
    """How rows are written; the first one may have a heading behind it, and does not tell."""
    form = dialect(rows[1:] or rows)
    begin, below = rows[:SOME], rows[SOME:]
    sample = [form.words(row) for row in (*begin, *below[:: max(len(below) // SAMPLE, 1)])]
    if len(rows) < FEW:
        return replace(form, columns=tuple(range(len(_trimmed(sample[0])))))
    in_columns = itertools.zip_longest(*sample, fillvalue="")
    return replace(form, columns=tuple(i for i, words in enumerate(in_columns) if _is_column(words)))


def _is_column(words: Sequence[str]) -> bool:
    """Whether most words are numbers, or most of those above the last that is, if they are no notes beside the rows."""
    filled = [i for i, word in enumerate(words, 1) if is_number(word)]
    return 2 * len(filled) > len(words) or (len(filled) >= SOME and 2 * len(filled) > filled[-1])


def _trimmed(words: Sequence[str]) -> Sequence[str]:
    """Words without an empty one behind the last separator."""
    return words[:-1] if len(words) > 1 and not words[-1] else words


def columns_of(rows: NumberedLines, form: RowForm, place: str, decimal_sign: str = "") -> list[Column]:
    """The numbers of each column; DataError with the line where a row has more or fewer.

    place: for messages; decimal_sign: where the file says it.
    """
    cells = _cells_at_once(form, rows.texts)
    if cells is None:
        words = [form.words(line) for line in rows.texts]
        _check_widths(rows, words, form, place)
        cells = [[row[i] if i < len(row) else "" for row in words] for i in form.columns]
    return read_columns(cells, rows.numbers, decimal_sign)


def _cells_at_once(form: RowForm, rows: Sequence[str]) -> list[list[str]] | None:
    """The words of each column where all rows are alike, many times as fast; None where they are not."""
    separator, n = (None if form.separator == BLANKS else form.separator), len(form.columns)
    text = (separator or " ").join(rows)
    widths = {len(row.split()) for row in rows} if separator is None else {row.count(separator) + 1 for row in rows}
    if widths != {n} or '"' in text or (separator is None and not text.isascii()):
        return None
    words = text.split(separator)
    words = [*map(str.strip, words)] if separator and " " in text else words
    return [words[i::n] for i in range(n)]


def _check_widths(rows: NumberedLines, words: Sequence[Sequence[str]], form: RowForm, place: str) -> None:
    """DataError for a row that goes on behind the last column, or stops before it unless some at the end all do."""
    last, width, usual = form.columns[-1], len(form.columns), statistics.mode(map(len, words))
    n_whole = max((i for i, row in enumerate(words, 1) if len(row) > last), default=0)
    may_stop = form.separator != BLANKS and len(words) - n_whole >= SOME
    for i, row in enumerate(words):
        is_short = len(row) <= last and not (may_stop and i >= n_whole)
        goes_on = len(row) > usual and any(map(is_number, row[last + 1 : last + 2]))
        goes_on = goes_on and sum(map(is_number, row)) != width
        if is_short or goes_on:
            n = sum(map(is_number, row))
            cure = "" if i else f"; pass over it with --skip {rows.numbers[0]}, and name the columns with --columns"
            raise DataError(f"{place}: line {rows.numbers[i]}: {n} numbers where other rows have {width}{cure}")
