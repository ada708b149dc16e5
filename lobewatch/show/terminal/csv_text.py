"""Tables with commas, for programs and spreadsheets; no text in them becomes a formula."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any

FORMULA = re.compile(r"(?![+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?\Z)[=+\-@\t\r]")
"""Beginning of a text that a spreadsheet takes for a formula; of a number never. As in report.js."""


def csv_text(lines: Iterable[Sequence[Any]]) -> str:
    """A table, its headings first; None is an empty cell."""
    return "".join(",".join(map(csv_cell, line)) + "\n" for line in lines)


def csv_cell(value: Any) -> str:
    """One cell; before a text that would be a formula stands an apostrophe, which keeps it a text."""
    text = "" if value is None else str(value)
    if isinstance(value, str) and FORMULA.match(text):
        text = f"'{text}"
    return '"{}"'.format(text.replace('"', '""')) if re.search('[",\r\n]', text) else text
