"""Answers to setup questions are parsed, and change only their own keys of machine.toml."""

from __future__ import annotations

from importlib import resources

import pytest

from lobewatch.machine.setup_questions.draft import MachineDraft, is_open_answer, parse_numbers
from lobewatch.machine.setup_questions.questions import SETUP_QUESTIONS, find_setup_question

pytestmark = pytest.mark.quick
TEMPLATE = resources.files("sim_data").joinpath("new_machine.toml").read_text("utf-8")


def test_numbers_are_read_with_units_and_decimal_commas() -> None:
    assert parse_numbers("15 kW, 40,5 Nm", ("power in kW", "torque in N m")) == [15.0, 40.5]
    with pytest.raises(ValueError, match=r"'horses'.* power in kW"):
        parse_numbers("15 horses", ("power in kW",))
    with pytest.raises(ValueError, match=r"'15' .*1 number.* power in kW, torque in N m"):
        parse_numbers("15", ("power in kW", "torque in N m"))


def test_an_answer_changes_only_its_own_table() -> None:
    draft = MachineDraft(TEMPLATE, {})
    question = find_setup_question("drive")
    assert is_open_answer(question.read_current(draft))
    answered = question.apply_answer(draft, "15 40")
    assert question.read_current(answered) == "15 40"
    assert answered.table("speed") == draft.table("speed")
    assert len({question.name for question in SETUP_QUESTIONS}) == len(SETUP_QUESTIONS) == 10
    with pytest.raises(ValueError, match=r"color.* name, speeds, drive"):
        find_setup_question("color")
