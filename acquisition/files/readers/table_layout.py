"""Detect separators, number columns and headings of a text table."""

import itertools
import re
import statistics
from collections.abc import Sequence
from dataclasses import dataclass, replace

from acquisition.errors import DataError, join_sentences
from acquisition.files.contents.column_headings import infer_role, is_unit, split_heading
from acquisition.files.contents.units import parse_unit
from acquisition.files.readers.number_format import Column, is_number, parse_columns
from acquisition.files.readers.text_file import NumberedLines, split_fields

LAYOUT_SAMPLE_ROWS = 200
"""Number of rows that show which words are columns."""
MIN_ROWS_FOR_TEXT_COLUMN = 3
"""Smallest number of rows in which a word that is no number makes a column of words instead of a mistake."""
MIN_SHORT_COLUMN_ROWS = 8
"""Smallest number of rows of a column that ends before half of the table, and of rows that stop before the last column.

A hit has no fewer samples, and notes have fewer rows. A few short rows at the end may have lost a number.
"""
BLANK_SEPARATOR = "[ \t]+"
"""Separator of words between blanks; none of them can be empty."""
_UNSIGNED_NUMBER = r"(?:\d++\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_COMPLEX_PAIR = re.compile(rf"\(\s*([+-]?{_UNSIGNED_NUMBER})\s*,\s*([+-]?{_UNSIGNED_NUMBER})\s*\)")
_COMMA_OR_POINT_NUMBER = _UNSIGNED_NUMBER.replace(r"\.", "[.,]")
"""Pattern of a number with a decimal point or comma."""
_COMPLEX_SUM = re.compile(rf"(?<!\d)({_COMMA_OR_POINT_NUMBER})\s*([+-])\s*({_COMMA_OR_POINT_NUMBER})\s*[ij]\b")
_TIMESTAMP = re.compile(r"\d{1,4}([-/.:])\d{1,2}\1\d{1,4}")
_NOT_FINITE = {"nan", "inf", "-inf", "+inf"}


@dataclass(frozen=True)
class RowLayout:
    """Layout of the rows of a table."""

    separator: str
    """Pattern between two words of a row."""
    columns: tuple[int, ...] = ()
    """Index of the words of a row that are numbers."""

    def split(self, line: str) -> list[str]:
        """Split a line into words."""
        line = line.strip(" \r\n") if self.separator == "\t" else line.strip()
        if '"' in line and self.separator != BLANK_SEPARATOR:
            return split_fields(line, self.separator)
        return [word.strip().strip('"') for word in re.split(self.separator, line)]


def normalize_complex(line: str) -> str:
    """Return a line with its complex numbers, `(1,2)` or `1 + 2i`, as Python writes them."""
    if "(" in line:
        line = _COMPLEX_PAIR.sub(lambda match: f"{match[1]}{'' if match[2][0] in '+-' else '+'}{match[2]}j", line)
    return _COMPLEX_SUM.sub(r"\1\2\3j", line) if "i" in line or "j" in line else line


def begins_with_number(line: str) -> bool:
    """Return whether a single line may be a row."""
    line = normalize_complex(line)
    word, *others = [*filter(None, detect_separator([line]).split(line)), ""]
    if _TIMESTAMP.match(word):
        return any(map(is_number, others))
    return is_number(word) and word.lower() not in _NOT_FINITE


def detect_separator(rows: Sequence[str]) -> RowLayout:
    """Detect the separator of rows; the first row with a comma shows what that is for."""
    for separator in ("\t", ";"):
        if separator in rows[0].strip():
            return RowLayout(separator)
    with_comma = next((row for row in rows if "," in row), "")
    words = re.split(BLANK_SEPARATOR, with_comma.strip())
    are_numbers = len(words) > 1 and all(is_number(word) and not word.endswith(",") for word in words)
    return RowLayout(BLANK_SEPARATOR if are_numbers or not with_comma else ",")


def detect_row_layout(rows: Sequence[str]) -> RowLayout:
    """Detect the layout of rows; the first one may have a heading behind it and does not count."""
    form = detect_separator(rows[1:] or rows)
    begin, below = rows[:MIN_SHORT_COLUMN_ROWS], rows[MIN_SHORT_COLUMN_ROWS:]
    sample = [form.split(row) for row in (*begin, *below[:: max(len(below) // LAYOUT_SAMPLE_ROWS, 1)])]
    if len(rows) < MIN_ROWS_FOR_TEXT_COLUMN:
        words = sample[0]
        return replace(form, columns=tuple(range(len(words) - (len(words) > 1 and not words[-1]))))
    in_columns = itertools.zip_longest(*sample, fillvalue="")
    return replace(form, columns=tuple(i for i, words in enumerate(in_columns) if _is_number_column(words)))


def _is_number_column(words: Sequence[str]) -> bool:
    """Return whether most words are numbers, or most of those above the last number where these are no notes."""
    filled = [i for i, word in enumerate(words, 1) if is_number(word)]
    return 2 * len(filled) > len(words) or (len(filled) >= MIN_SHORT_COLUMN_ROWS and 2 * len(filled) > filled[-1])


def read_columns(rows: NumberedLines, form: RowLayout, place: str, decimal_sign: str = "") -> list[Column]:
    """Read the numbers of each column; raise DataError with the line where a row has more or fewer.

    place: for messages; decimal_sign: where it is known.
    """
    cells = _split_cells_fast(form, rows.texts)
    if cells is None:
        words = [form.split(line) for line in rows.texts]
        _check_widths(rows, words, form, place)
        cells = [[row[i] if i < len(row) else "" for row in words] for i in form.columns]
    return parse_columns(cells, rows.numbers, decimal_sign)


def _split_cells_fast(form: RowLayout, rows: Sequence[str]) -> list[list[str]] | None:
    """Split rows of the same layout at once; None if rows differ."""
    separator, n = (None if form.separator == BLANK_SEPARATOR else form.separator), len(form.columns)
    text = (separator or " ").join(rows)
    widths = {len(row.split()) for row in rows} if separator is None else {row.count(separator) + 1 for row in rows}
    if widths != {n} or '"' in text or (separator is None and not text.isascii()):
        return None
    words = text.split(separator)
    words = [*map(str.strip, words)] if separator and " " in text else words
    return [words[i::n] for i in range(n)]


def _check_widths(rows: NumberedLines, words: Sequence[Sequence[str]], form: RowLayout, place: str) -> None:
    """Raise DataError for a row that goes on behind the last column, or stops early unless all rows at the end do."""
    last, width, usual = form.columns[-1], len(form.columns), statistics.mode(map(len, words))
    n_whole = max((i for i, row in enumerate(words, 1) if len(row) > last), default=0)
    may_stop = form.separator != BLANK_SEPARATOR and len(words) - n_whole >= MIN_SHORT_COLUMN_ROWS
    for i, row in enumerate(words):
        is_short = len(row) <= last and not (may_stop and i >= n_whole)
        goes_on = len(row) > usual and any(map(is_number, row[last + 1 : last + 2]))
        goes_on = goes_on and sum(map(is_number, row)) != width
        if is_short or goes_on:
            n = sum(map(is_number, row))
            found = f"{place}: line {rows.numbers[i]}: {n} numbers, but the other rows have {width}"
            skip = f"Skip this line with Description.skip {rows.numbers[0]}"
            raise DataError(join_sentences(found, "" if i else f"{skip}, and give Description.columns"))


Heading = list[tuple[str, str]]
"""Name and unit of each column; empty if unknown."""
_RATIO_LABEL = "Units: Ratio"
_UNIT_PRODUCT = re.compile(r"(\(.+\))(\(.+\))")
_LETTER = re.compile(r"[^\W\d_]")
_UNIT_LABEL = re.compile(r"unit|einheit|unidad|単位|单位", re.IGNORECASE)
"""Label at the beginning of a line of units."""
_COMMENT_MARK = re.compile(r"^\s*[#%!*/]+\s*")
"""Mark of a comment."""
_SPACE_BEFORE_BRACKET = re.compile(r"\s+(?=[\[(])")


def find_heading_above(lines: Sequence[str], form: RowLayout, width: int) -> Heading:
    """Find the names and units above a table.

    The nearest line with a word for each column, most of them known, has the names. A line of units has the units.
    Empty where no line has so many words. width: words of a row.
    """
    lines = [_COMMENT_MARK.sub("", line) for line in lines]
    by_line = [words for line in reversed(lines) if (words := _split_words(line, form, width))]
    units = next((words for words in by_line if _are_units(words)), [])
    named = [words for words in by_line if any(map(_LETTER.search, words)) and not any(map(is_number, words))]
    names = [words for words in named if words is not units] or [[""] * len(units)]
    in_turn = _split_words(lines[-1], replace(form, columns=tuple(range(2 * len(form.columns)))), 0) if lines else []
    if in_turn and all(in_turn[::2]) and is_unit(in_turn[1]):
        return _pair_alternating(in_turn)
    best = max(names, key=lambda words: sum(bool(infer_role(*split_heading(word))) for word in words))
    return _pair_names_and_units(best, units, is_ratio=_RATIO_LABEL in lines)


def find_heading_behind(row: str, form: RowLayout) -> Heading:
    """Find the names and units behind the numbers of a row, a name and a unit per column or only names; else empty."""
    width = len(form.columns)
    separator = r"\s+" if form.separator in (BLANK_SEPARATOR, "\t") else form.separator
    words = re.split(separator, row.strip(), maxsplit=width)
    if len(words) <= width or not all(map(is_number, words[:width])) or is_number((words[width].split() or [""])[0]):
        return []
    names = [word for word in re.split(r"\s*\t\s*|\s*;\s*|\s+", words[width].strip()) if word]
    if len(names) == 2 * width:
        return _pair_alternating(names)
    return [split_heading(name) for name in names] if len(names) == width else []


def _pair_alternating(words: Sequence[str]) -> Heading:
    """Pair a name and a unit of each column in turn."""
    return [(name, unit if is_unit(unit) else "") for name, unit in zip(words[::2], words[1::2], strict=True)]


def is_unit_line(lines: Sequence[str], form: RowLayout, width: int) -> bool:
    """Return whether the last of these lines is a line of units."""
    return bool(lines) and _are_units(_split_words(lines[-1], form, width))


def _split_words(line: str, form: RowLayout, width: int) -> list[str]:
    """Split a line into a word per column with any separator; empty if there are more or fewer words."""
    joined = _SPACE_BEFORE_BRACKET.sub("", line)
    for separator in (form.separator, "\t", ";", ",", "[ \t]{2,}", BLANK_SEPARATOR):
        if separator in ",;\t":
            words = split_fields(line.strip(" \r\n"), separator)
        else:
            words = re.split(separator, joined.strip())
        if len(words) == width:
            return [words[i] for i in form.columns]
        while len(words) > len(form.columns) and not words[-1]:
            words.pop()
        if len(words) == len(form.columns):
            return words
    return []


def _are_units(words: Sequence[str]) -> bool:
    """Return whether all words are units, or the first is one of time or frequency and no other a known name."""
    bare = [word.strip("()[] ") for word in words if not _UNIT_LABEL.match(word)]
    if not any(bare):
        return False
    if all(not word or word == "-" or is_unit(word) for word in bare):
        return True
    first = parse_unit(bare[0])
    is_axis = first is not None and first.quantity in ("time", "frequency")
    return is_axis and not any(infer_role(word, "") for word in bare)


def _pair_names_and_units(names: Sequence[str], units: Sequence[str], *, is_ratio: bool) -> Heading:
    """Pair names and units; is_ratio: whether a product of units is meant as a ratio."""
    if not units:
        return [split_heading(name) for name in names]
    labels = ["" if _UNIT_LABEL.match(word) else word for word in units]
    bare = [word.strip("()[] ") if parse_unit(word) is None else word for word in labels]
    texts = [_UNIT_PRODUCT.sub(r"\1/\2", unit) if is_ratio else unit for unit in bare]
    return [(name, text.strip("-")) for name, text in zip(names, texts, strict=True)]
