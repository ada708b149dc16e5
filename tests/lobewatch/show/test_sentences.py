"""Test wrapped lists: no line too long, no number without its unit."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lobewatch.show.terminal.sentences import MAX_LINE_LENGTH, wrap_lines

pytestmark = pytest.mark.quick


WORDS = ["Run", "this", "depth", "at", "11 440 rpm,", "2 %", "±0.1 Hz"]


@given(st.lists(st.sampled_from(WORDS), min_size=1, max_size=60))
def test_lines_are_short_and_keep_numbers_with_their_units(words: list[str]) -> None:
    lines = wrap_lines([" ".join(words)])
    assert max(map(len, lines)) <= MAX_LINE_LENGTH
    assert not [line for line in lines if re.search("[0-9]$", line)]
    assert " ".join(line.strip() for line in lines) == " ".join(words)
    assert [line[:4].isspace() for line in lines] == [False, *[True] * (len(lines) - 1)]


def test_control_characters_and_line_breaks_do_not_pass() -> None:
    assert wrap_lines(["a\nb\x1b[31m"]) == ["  a b\ufffd[31m"]
