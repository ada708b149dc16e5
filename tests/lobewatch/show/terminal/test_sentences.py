"""Lines of lists: at most 80 characters, with numbers, units and commands in one piece."""

from __future__ import annotations

import pytest

from acquisition.errors import join_sentences
from lobewatch.show.terminal.sentences import MAX_LINE_LENGTH, wrap_lines

COMMAND = "lobewatch replay mill mill/taps/a.h5 --accept clock-behind"


@pytest.mark.parametrize("before", range(0, 60, 7))
def test_a_command_is_copied_in_one_piece(before: int) -> None:
    lines = wrap_lines([f"{'x' * before} tap again, or run {COMMAND} to confirm the date of the test"])
    assert sum(COMMAND in line for line in lines) == 1
    assert max(map(len, lines)) <= MAX_LINE_LENGTH


def test_a_number_stays_with_its_unit_and_further_lines_are_indented() -> None:
    first, *others = wrap_lines([" ".join(["depth margin 57 %"] * 12)])
    assert others
    assert all(line.startswith("    ") for line in others)
    assert not any(line.endswith("57") for line in [first, *others])


@pytest.mark.parametrize(
    ("parts", "joined"),
    [(("a b", "C d"), "a b. C d."), (("a b", ""), "a b"), (("Is it V?", "Give it"), "Is it V? Give it."), ((), "")],
)
def test_sentences_are_joined_with_one_full_stop_each(parts: tuple[str, ...], joined: str) -> None:
    assert join_sentences(*parts) == joined
