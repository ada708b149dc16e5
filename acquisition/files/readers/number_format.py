"""Parse numbers with decimal points or commas and thousands separators.

A number shows what a comma or a point is for where it can be only one thing: `0,5` and `1,2e-6` have a decimal comma,
`1,234.5` and `1,234,567` have commas between thousands. `1,234` may be either.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from acquisition.arrays import Floats

SignUse = Literal["decimal", "thousands", "doubtful"]
"""Use of a sign in a number."""
NumberFormat = Mapping[str, SignUse]
"""Use of a comma and of a point in the numbers of a column."""
PLAIN_NUMBER_FORMAT: NumberFormat = {",": "decimal", ".": "decimal"}
"""Format with a decimal point or comma and nothing between thousands."""
_OTHER_SIGN = {",": ".", ".": ","}
_BLANK_CHARACTERS = " \u00a0\u2009\u202f'\u2019"
"""Blanks between thousands, some of them non-breaking or thin, and apostrophes."""
_EXPONENT = r"(?:[eEdD][+-]?\d+)?"
_THOUSANDS_PATTERN = {
    sign: re.compile(rf"[+-]?[1-9]\d{{0,2}}(?:[{sign}]\d{{3}})+(?:[{other}]\d*)?")
    for sign, other in _OTHER_SIGN.items()
}
_DECIMAL_PATTERN = {
    sign: re.compile(
        rf"\(?[+-]?(?:\d*|[1-9]\d{{0,2}}(?:[{_BLANK_CHARACTERS}{other}]\d{{3}})+)[{sign}]\d+{_EXPONENT}(?:[+-][\d.,]+{_EXPONENT}j)?\)?"
    )
    for sign, other in _OTHER_SIGN.items()
}
_WITH_BLANKS = re.compile(rf"[+-]?[1-9]\d{{0,2}}(?:[{_BLANK_CHARACTERS}]\d{{3}})+(?:[.,]\d*)?{_EXPONENT}")
_IMAGINARY = re.compile(r"\(?[^a-df-zA-DF-Z]*[\d.]j\)?")
_MISSING_VALUE = re.compile(r"#?N/A|#NUM!|#DIV/0!|#VALUE!|[+-]?1[.,]#(IND|INF|QNAN|SNAN)0*", re.IGNORECASE)
"""Missing value as spreadsheets and older C libraries write it."""


def _parse_word(word: str, numerals: NumberFormat) -> complex:
    """Parse a word, real if possible; raise ValueError with the end of a sentence if it is no number."""
    plain = re.sub(f"[{_BLANK_CHARACTERS}]", "", word) if _WITH_BLANKS.fullmatch(word) else word
    for sign, use in numerals.items():
        if use != "decimal" and sign in plain:
            plain = _remove_thousands(plain, sign, use)
    try:
        return _parse_number(plain.replace(",", "."))
    except ValueError:
        raise ValueError("not a number") from None


def _remove_thousands(word: str, sign: str, use: SignUse) -> str:
    """Remove the separators of thousands; raise ValueError where their use is unknown or their place is wrong."""
    if not _THOUSANDS_PATTERN[sign].fullmatch(word):
        raise ValueError("not a number")
    if use == "doubtful":
        either = f"{word.replace(sign, '.')} or {word.replace(sign, '')}"
        raise ValueError(f"which may be {either} (choose Description.decimal comma or Description.decimal point)")
    return word.replace(sign, "")


def _infer_formats(columns: Sequence[Sequence[str]]) -> list[NumberFormat]:
    """Infer the number format of each column from its numbers, else from the other columns where they agree."""
    commas, points = ([_infer_sign_use(sign, column) for column in columns] for sign in _OTHER_SIGN)
    comma, point = _agree_on_use(commas), _agree_on_use(points)
    if point == "doubtful" and not {"decimal", "doubtful"} & {*commas}:
        point = "decimal"
    uses = zip(_resolve_uses(commas, comma), _resolve_uses(points, point), strict=True)
    return [{",": of_comma, ".": of_point} for of_comma, of_point in uses]


def _infer_sign_use(sign: str, words: Sequence[str]) -> SignUse | None:
    """Infer the use of a sign from words; None if no number has it."""
    if sign not in "".join(words):
        return None
    uses = (use for word in words if sign in word if (use := _classify_sign(sign, word)) is not None)
    first = next(uses, None)
    return next((use for use in uses if use != "doubtful"), first) if first == "doubtful" else first


def _agree_on_use(uses: Sequence[SignUse | None]) -> SignUse:
    """Return the use of a sign that all columns agree on, else "doubtful"."""
    certain = {use for use in uses if use in ("decimal", "thousands")}
    return certain.pop() if len(certain) == 1 else "doubtful"


def _resolve_uses(uses: Sequence[SignUse | None], agreed: SignUse) -> list[SignUse]:
    return [agreed if use == "doubtful" else use or "decimal" for use in uses]


def _classify_sign(sign: str, word: str) -> SignUse | None:
    if _THOUSANDS_PATTERN[sign].fullmatch(word):
        return "thousands" if word.count(sign) > 1 or _OTHER_SIGN[sign] in word else "doubtful"
    return "decimal" if _DECIMAL_PATTERN[sign].fullmatch(word) else None


def is_number(word: str) -> bool:
    """Return whether a word is a number in any format."""
    try:
        _parse_word(word, PLAIN_NUMBER_FORMAT)
    except ValueError:
        return any(_classify_sign(sign, word) for sign in _OTHER_SIGN)
    return True


def _parse_number(plain: str) -> complex:
    """Parse a number with a decimal point; raise ValueError if it is none."""
    try:
        return float(plain)
    except ValueError:
        if _MISSING_VALUE.fullmatch(plain):
            return math.nan
        return complex(plain) if _IMAGINARY.fullmatch(plain) else float(re.sub("[dD]", "e", plain))


@dataclass(frozen=True, eq=False)
class Column:
    """Numbers of a column, up to its last cell that is not empty."""

    values: NDArray[Any]
    """Numbers, complex where one is, NaN where a cell holds none; shape (n,)."""
    flaws: Mapping[int, str]
    """Fault of each cell without a number, as "is empty in line 7", by its index."""


def parse_columns(columns: Sequence[Sequence[str]], lines: Sequence[int], decimal_sign: str = "") -> list[Column]:
    """Parse the cells of each column, one cell per line.

    decimal_sign: a comma or a point where it is known; the other one separates thousands then.
    """
    written = _infer_formats(columns)
    if decimal_sign in _OTHER_SIGN:
        written = [{decimal_sign: "decimal", _OTHER_SIGN[decimal_sign]: "thousands"}] * len(columns)
    return [_parse_column(cells, lines, numerals) for cells, numerals in zip(columns, written, strict=True)]


def _parse_column(cells: Sequence[str], lines: Sequence[int], numerals: NumberFormat) -> Column:
    n = len(cells)
    while n and not cells[n - 1]:
        n -= 1
    at_once = _parse_fast(cells[:n], numerals)
    if at_once is not None:
        return Column(at_once, {})
    values, flaws = list[complex](), dict[int, str]()
    for i, (cell, line) in enumerate(zip(cells[:n], lines, strict=False)):
        try:
            values.append(_parse_word(cell, numerals))
            fault = "not a number" if math.isnan(values[-1].real) else ""
        except ValueError as error:
            values.append(math.nan)
            fault = str(error)
        if fault:
            flaws[i] = f"has {cell!r} in line {line}, {fault}" if cell else f"is empty in line {line}"
    return Column(np.array(values), flaws)


def _parse_fast(cells: Sequence[str], numerals: NumberFormat) -> Floats | None:
    """Parse cells at once; None if a number is complex or missing, or has thousands."""
    text = "\n".join(cells)
    if any(use != "decimal" and sign in text for sign, use in numerals.items()):
        return None
    try:
        values = np.array([*map(float, text.replace(",", ".").split("\n") if "," in text else cells)])
    except ValueError:
        return None
    return None if np.isnan(values).any() else values
