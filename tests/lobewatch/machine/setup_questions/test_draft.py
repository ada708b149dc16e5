"""Answers to setup questions are parsed, and change only their own keys of machine.toml."""

from __future__ import annotations

from importlib import resources

import pytest

from lobewatch.machine.settings.number_text import parse_numbers
from lobewatch.machine.setup_questions.draft import MachineDraft, is_open_answer
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


@pytest.mark.parametrize(
    "answer", ["1,000 18,000", "1.000 18.000", "1'000, 18'000 rpm", "1\u202f000 18\u202f000", "1e3 18e3"]
)
def test_separated_thousands_of_speeds_are_thousands(answer: str) -> None:
    table = find_setup_question("speeds").apply_answer(MachineDraft(TEMPLATE, {}), answer).table("speed")
    assert (table["low_rpm"], table["high_rpm"]) == (1000, 18000)


@pytest.mark.parametrize("answer", ["12,000 18", "1 000 18 000", "18 000", "1,000,18,000"])
def test_speeds_of_two_values_or_another_count_are_rejected(answer: str) -> None:
    with pytest.raises(ValueError, match=r"1|8"):
        find_setup_question("speeds").apply_answer(MachineDraft(TEMPLATE, {}), answer)


@pytest.mark.parametrize(
    ("answer", "facts"),
    [
        ("1,5 18,000", "1.5.* 10 to 60000"),
        ("9.99 18000", "9.99.* 10 to 60000"),
        ("0 18000", "0.* 10 to 60000"),
        ("1000 18", "18.* 300 to 250000"),
        ("1000 250001", "250001.* 300 to 250000"),
    ],
)
def test_speeds_that_no_spindle_has_are_rejected(answer: str, facts: str) -> None:
    with pytest.raises(ValueError, match=facts):
        find_setup_question("speeds").apply_answer(MachineDraft(TEMPLATE, {}), answer)


@pytest.mark.parametrize("answer", ["10 300", "60000 250000"])
def test_the_ends_of_the_plausible_speeds_are_accepted(answer: str) -> None:
    table = find_setup_question("speeds").apply_answer(MachineDraft(TEMPLATE, {}), answer).table("speed")
    assert f"{table['low_rpm']:g} {table['high_rpm']:.0f}" == answer


def test_each_answer_knows_its_plausible_range() -> None:
    draft = MachineDraft(TEMPLATE, {})
    draft = find_setup_question("tool").apply_answer(draft, "4 12.700 30 80,500")
    draft = find_setup_question("material").apply_answer(draft, "1,400 500")
    draft = find_setup_question("hammer").apply_answer(draft, "0 2.248 5")
    draft = find_setup_question("program").apply_answer(draft, "slot: 8.000 2,125 12,7 0,125")
    program = draft.table("program", 0)
    assert (program["speed_rpm"], program["depth_mm"], program["feed_per_tooth_mm"]) == (8000, 2.125, 0.125)
    assert (program["tool_diameter_mm"], program["tangential_n_per_mm2"]) == (12.7, 1400)
    assert draft.table("daq.channel", 0)["sensitivity_mv_per_n"] == 2.248
