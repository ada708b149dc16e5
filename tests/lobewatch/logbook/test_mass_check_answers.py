"""Passed checks with a known mass before and after a tap test answer the question about the compliance of a tool."""

from __future__ import annotations

from datetime import timedelta

import pytest

from lobewatch.logbook import Logbook
from lobewatch.machine.folder_updates import exclude_entry
from lobewatch.machine.journal.mass_checks import MassCheckEntry, SensorChain, proves_sensitivities
from lobewatch.measurement.recording_questions import TOOL_COMPLIANCE, TOOL_MISMATCH_CODE
from tests.lobewatch.logbook.conftest import DAY, Shop, entered, hit_mass, tap_both

STIFF_TOOL = '[[tool]]\nname = "plain"\ndiameter_mm = 50\ntool_material = "carbide"\nstick_out_mm = 220\n\n'
"""Tool that alone is softer than the tapped tip."""


@pytest.fixture
def mismatched(plain: Shop) -> Shop:
    """Return a machine whose tip is stiffer than its tool as entered, tapped in x and y."""
    text = plain.path.joinpath("machine.toml").read_text("utf-8")
    plain.path.joinpath("machine.toml").write_text(text.replace("[[program]]", STIFF_TOOL + "[[program]]", 1), "utf-8")
    tap_both(plain)
    return plain


def codes(shop: Shop) -> set[str]:
    """Return the codes about the tool that all rows have."""
    rows = Logbook.open(shop.path).history.rows
    wanted = {TOOL_COMPLIANCE.code, TOOL_MISMATCH_CODE}
    found = [{remark.code for remark in row.remarks} & wanted for row in rows]
    assert all(each == found[0] for each in found)
    return found[0]


@pytest.mark.parametrize(
    ("days", "is_answered"),
    [
        *[((-0.9, 0.9), True), ((-0.1, 0.1, 40.0), True), ((0.5,), False), ((-0.5,), False), ((30.0,), False)],
        *[((-2.0, 0.1), False), ((-0.1, 2.0), False), ((0.1, 0.2), False)],
    ],
)
def test_passed_checks_of_the_day_before_and_after_answer_the_question(
    mismatched: Shop, days: tuple[float, ...], is_answered: bool
) -> None:
    """One alone shows no amplifier that was switched between it and the tap test."""
    assert codes(mismatched) == {TOOL_COMPLIANCE.code}
    assert Logbook.open(mismatched.path).history.questions
    for day in days:
        hit_mass(mismatched, day)
    assert codes(mismatched) == {TOOL_MISMATCH_CODE if is_answered else TOOL_COMPLIANCE.code}
    assert (not Logbook.open(mismatched.path).history.questions) is is_answered


def test_a_check_that_fails_or_is_excluded_or_of_another_chain_answers_nothing(mismatched: Shop) -> None:
    hit_mass(mismatched, -0.5)
    hit_mass(mismatched, 0.2)
    hit_mass(mismatched, 0.5, ratio=2.0)
    hit_mass(mismatched, 0.6, entered(1.2))
    assert codes(mismatched) == {TOOL_COMPLIANCE.code}
    passed = hit_mass(mismatched, 0.9)
    assert codes(mismatched) == {TOOL_MISMATCH_CODE}
    exclude_entry(mismatched.folder, passed.id, "wrong mass")
    assert codes(mismatched) == {TOOL_COMPLIANCE.code}


def test_the_check_of_an_emulator_proves_no_sensitivities() -> None:
    chain = SensorChain("1", 1e-3, 1e-2, 5.0, 5.0)

    def proves(*masses: float | None) -> bool:
        days = zip((-0.5, 0.5), masses, strict=True)
        checks = [MassCheckEntry("m", DAY + timedelta(day), mass, 1.0, 1e-3, True, chain) for day, mass in days]
        return proves_sensitivities(chain, DAY, checks)

    assert proves(1.2, 1.2)
    assert not proves(None, 1.2)
    assert not proves(1.2, None)
