"""Test CSV: each cell is read back, and none is a formula in a spreadsheet."""

from __future__ import annotations

import csv
import io

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lobewatch.show.terminal.option_names import with_option_names
from lobewatch.show.terminal.output import format_csv

TEXTS = st.text(st.sampled_from("=+-@\t\r\n,\"'0e. a"), max_size=6) | st.text()
TEXTS = TEXTS.filter(lambda text: with_option_names(text) == text)


@given(st.lists(st.tuples(TEXTS, TEXTS, st.floats(allow_nan=False))))
def test_every_cell_is_read_back_and_none_runs(lines: list[tuple[str, str, float]]) -> None:
    read = [*csv.reader(io.StringIO(format_csv(lines), newline=""))]
    assert len(read) == len(lines)
    for line, cells in zip(lines, read, strict=True):
        assert float(cells[2]) == line[2]
        for text, cell in zip(line[:2], cells[:2], strict=True):
            assert cell in (text, f"'{text}")
            assert cell == text or text[0] in "=+-@\t\r"


@pytest.mark.parametrize(
    "text",
    [
        "=cmd|' /C calc'!A0",
        "=1+1",
        "+1+1",
        "-1-1",
        "@SUM(A1)",
        "\t=1",
        "\r=1",
        "-",
        "--1",
        "+-3",
        "-1e",
        "-5 mm",
        "-1\n",
    ],
)
def test_a_text_that_a_spreadsheet_would_run_gets_an_apostrophe(text: str) -> None:
    assert [*csv.reader(io.StringIO(format_csv([[text, 1]]), newline=""))] == [[f"'{text}", "1"]]


@pytest.mark.parametrize(
    "number", ["-0.5", "+3", "1e-3", "-1e-3", "-.5E+10", "-5.", -0.5, -1e-300, 7, None, "a=b", "'=1"]
)
def test_numbers_and_other_texts_stay_as_they_are(number: str | float | None) -> None:
    assert format_csv([[number, ""]]) == f"{'' if number is None else number},\n"
