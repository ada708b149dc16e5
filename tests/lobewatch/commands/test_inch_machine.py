"""A machine in inches: lengths that people enter and read, and JSON that stays metric."""

from __future__ import annotations

import json
import os
import re
from importlib import resources
from pathlib import Path
from typing import Any

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from msgspec.structs import replace
from typer.testing import Result

from lobewatch.machine.settings.display_units import (
    FEED_PER_TOOTH,
    FEED_RATE,
    LENGTH,
    REMOVAL_RATE,
    read_units,
    shown_units,
)
from lobewatch.machine.settings.setting_questions import find_program_questions
from lobewatch.machine.setup_questions.draft import MachineDraft
from lobewatch.machine.setup_questions.questions import find_setup_question
from tests.lobewatch.commands.invoke import invoke

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""
METRIC_WORD = re.compile(r"\d ?mm\b|\(mm\)|m/min|cm3")
TEMPLATE = resources.files("sim_data").joinpath("new_machine.toml").read_text("utf-8")


@pytest.fixture
def inch(shop: Shop) -> Shop:
    shop.tap_both()
    shop.edit("[machine]", '[machine]\nunits = "inch"')
    return shop


def ask(*words: str) -> Result:
    return invoke(words)


def as_metric(shop: Shop, *arguments: str) -> str:
    shop.edit('units = "inch"', 'units = "metric"')
    answer = ask(*arguments)
    shop.edit('units = "metric"', 'units = "inch"')
    return str(answer.stdout)


def test_an_inch_is_25_4_mm_in_all_quantities() -> None:
    assert LENGTH.text(25.4) == "25.4 mm"
    with shown_units("inch"):
        assert (LENGTH.text(25.4), LENGTH.number(12.7, ".2f"), LENGTH.scale) == ("1 in", "0.5000", 1 / 25.4)
        assert FEED_PER_TOOTH.text(0.0508) == "0.002 in"
        assert FEED_RATE.text(2540.0, ".0f") == "100.0 in/min"
        assert REMOVAL_RATE.text(16.387064, ".3g") == "1 in3/min"
    assert LENGTH.text(25.4) == "25.4 mm"


@given(st.floats(0.01, 300))
def test_a_depth_that_must_not_be_exceeded_is_rounded_down(depth: float) -> None:
    with shown_units("inch"):
        shown = float(LENGTH.text_at_most(depth).removesuffix(" in"))
    assert 0 <= depth - 25.4 * shown <= 0.00254 + 1e-6


@pytest.mark.parametrize("command", ["check", "lobes", "history", "status"])
def test_no_text_shows_a_metric_length(inch: Shop, command: str) -> None:
    answer = ask(command, str(inch.path))
    assert answer.exit_code < 2
    assert not METRIC_WORD.search(answer.output.replace("N/mm2", ""))
    assert command in ("history", "status") or "in" in answer.output


def test_recommended_settings_are_in_inches(inch: Shop) -> None:
    options = "--tool", "reference", "--material", "AA 7075", "--teeth", "4", "--diameter", "1/2"
    answer = ask("recommend", str(inch.path), *options)
    assert answer.exit_code == 0
    assert not METRIC_WORD.search(answer.output)


@pytest.mark.long
def test_a_recommendation_in_json_is_the_same_in_both_units(inch: Shop) -> None:
    options = "--tool", "reference", "--material", "AA 7075", "--teeth", "4", "--diameter"
    metric = as_metric(inch, "recommend", str(inch.path), *options, "12.7", "--json")
    assert ask("recommend", str(inch.path), *options, "1/2", "--json").stdout == metric


@pytest.mark.parametrize("command", ["check", "status"])
def test_json_is_the_same_in_both_units(inch: Shop, command: str) -> None:
    arguments = command, str(inch.path), "--json", "--now", "2026-01-20"
    seen = ask(*arguments).stdout
    assert json.loads(seen)
    assert seen == as_metric(inch, *arguments)


@pytest.mark.parametrize("depth", ["0.1", "1/10", "2.54mm"])
def test_a_bare_length_of_an_option_is_in_inches(inch: Shop, depth: str) -> None:
    assert ask("observe", str(inch.path), "--program", "A", "--depth", depth, "--stable").exit_code == 0
    (cut,) = inch.logbook.cuts
    assert cut.depth == pytest.approx(2.54e-3, rel=1e-12)


def test_the_report_is_in_inches(inch: Shop) -> None:
    assert ask("report", str(inch.path)).exit_code == 0
    page = (inch.path / "report.html").read_text("utf-8")
    assert "ap (in)" in page
    assert "(mm)" not in re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes")
@pytest.mark.timeout(20)
def test_units_of_a_pipe_and_of_deep_tables_are_metric(tmp_path: Path) -> None:
    path = tmp_path / "machine.toml"
    os.mkfifo(path)
    assert read_units(tmp_path) == "metric"
    path.unlink()
    path.write_text("[machine]\nunits = " + "[" * 50_000, "utf-8")
    assert read_units(tmp_path) == "metric"
    path.write_text('\ufeff[machine]\r\nunits = "inch"\r\n', "utf-8")
    assert read_units(tmp_path) == "inch"


def test_refused_depths_are_in_inches(inch: Shop) -> None:
    options = "--tool", "reference", "--material", "AA 7075", "--teeth", "4", "--diameter", "1/2"
    with pytest.raises(ValueError, match=r"--depth 2\.5 is deeper .* 0\.5 in\."):
        ask("recommend", str(inch.path), *options, "--depth", "2.5")
    with pytest.raises(ValueError, match=r"--depth 0 is not above 0.* in\."):
        ask("observe", str(inch.path), "--program", "A", "--depth", "0", "--stable")


def test_questions_about_settings_are_in_inches(inch: Shop) -> None:
    inch.edit("[tap]", "[tap]\nstick_out_mm = 500")
    machine = inch.logbook.machine
    slow = replace(machine.all_programs[0], tool_diameter_mm=25.4, speed_rpm=10.0)
    with shown_units("inch"):
        reasons = {question.key: question.reason for question in find_program_questions(machine, slow, on_model=False)}
    assert "2.62 sfm" in reasons["speed_rpm"]
    assert "outside 9.84" in reasons["speed_rpm"]
    assert "diameters of 1 in," in reasons["stick_out_mm"]


def answer(units: Any, name: str, text: str) -> MachineDraft:
    draft = MachineDraft(TEMPLATE, {}).set("machine", units=units)
    with shown_units(units):
        return find_setup_question(name).apply_answer(draft, text)


@settings(max_examples=10)
@given(st.integers(1, 127), st.integers(0, 4))
def test_a_setup_in_inches_is_the_setup_in_millimetres(parts: int, wholes: int) -> None:
    """A cutter diameter in parts of an inch, as a fraction, a decimal and in mm."""
    inches = wholes + parts / 128
    assume(inches > 0.02)
    texts = {
        ("inch", f"4 {wholes}-{parts}/128 30"),
        ("metric", f"4 {wholes}-{parts}/128in 30"),
        ("inch", f"4 {inches!r} 30"),
        ("metric", f'4 {inches!r}" 30'),
        ("metric", f"4 {25.4 * inches:.12g} 30"),
        ("inch", f"4 {25.4 * inches:.12g}mm 30"),
    }
    found = {answer(units, "tool", text).table("reference_cut")["tool_diameter_mm"] for units, text in texts}
    assert found == {float(f"{25.4 * inches:.12g}")}


def test_the_present_answer_of_an_inch_machine_keeps_its_settings() -> None:
    draft = answer("inch", "program", "slot: 8000 0.08 1/2 0.004")
    draft = find_setup_question("tool").apply_answer(draft, "4 12.7mm 30 50mm carbide")
    with shown_units("inch"):
        for name in ("tool", "program"):
            question = find_setup_question(name)
            assert question.apply_answer(draft, question.read_current(draft)).text == draft.text
    cut = draft.table("program", 0)
    assert [cut[key] for key in ("depth_mm", "radial_depth_mm", "feed_per_tooth_mm")] == [2.032, 12.7, 0.1016]


@pytest.mark.parametrize(
    ("name", "text"), [("tool", "4in 20 30"), ("tool", "4 1/2 30"), ("tool", "4 0.5 im 30"), ("drive", "10in 40")]
)
def test_another_unit_and_a_fraction_without_unit_are_refused(name: str, text: str) -> None:
    with pytest.raises(ValueError, match=re.escape(text.split()[1] if "im" not in text else "im") + "|in"):
        answer("metric", name, text)
    assert answer("metric", "drive", "10 hp 40").table("drive")["power_kw"] == pytest.approx(7.45699872)
