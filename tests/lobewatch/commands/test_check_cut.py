"""`lobewatch check` of a cut that is no program."""

from __future__ import annotations

import re
from typing import Any

import pytest

from tests.lobewatch.commands.conftest import Check

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""


def test_a_cut_is_evaluated_without_a_program_as_one(shop: Shop, check: Check, no_search: None) -> None:
    shop.tap_both()
    text = (shop.path / "machine.toml").read_bytes()
    said = check("--speed", "8700", "--depth", "0.4", "--json")
    asked, program = said.programs["8700 rpm, 0.4 mm"], check("--program", "B", "--json").programs["B"]
    assert said.code == 0
    assert asked.keys() == program.keys()
    same = ("speed_rpm", "depth_mm", "feed", "verdict", "limit_mm", "limit_low_mm", "limit_high_mm", "doubt", "tap_id")
    assert {key: asked[key] for key in same} == {key: program[key] for key in same}
    assert (asked["was_stable_at_first"], (shop.path / "machine.toml").read_bytes()) == (None, text)
    assert check("--speed", "12900", "--depth", "6").code == 1


def test_a_material_and_a_geometry_may_be_given_for_a_cut(shop: Shop, check: Check, no_search: None) -> None:
    shop.tap_both()
    cut = ("--speed", "8700", "--depth", "0.2", "--material", "1.0503")
    assert re.search(r"Kt -25..\+30 %, Kr/Kt -52..\+100 %.*C45", check(*cut).out)
    geometry = ("--radial", "10", "--direction", "up", "--teeth", "3", "--diameter", "25")
    asked = check(*cut, *geometry, "--json").programs["8700 rpm, 0.2 mm"]
    shop.run(("A", 8700, 0.2))
    shop.edit("tangential_n_per_mm2 = 1400\nradial_n_per_mm2 = 500\nspeed", 'material = "C45"\nspeed')
    slot = 'teeth = 4\ntool_diameter_mm = 20\nradial_depth_mm = 20\ndirection = "down"\nmaterial'
    shop.edit(slot, 'teeth = 3\ntool_diameter_mm = 25\nradial_depth_mm = 10\ndirection = "up"\nmaterial')
    written = check("--json").programs["A"]
    assert [remark["code"] for remark in asked["remarks"]] == [remark["code"] for remark in written["remarks"]]
    alike = {"name": "A", "was_stable_at_first": None, "remarks": written["remarks"]}  # they name the cut
    assert asked | alike == written


def test_what_is_missing_of_a_cut_is_asked_for_in_one_message(shop: Shop, check: Check) -> None:
    shop.tap_both()
    said = check("--tool", "long end mill", "--speed", "8700", "--teeth", "2")
    assert (said.code, said.out) == (2, "")
    assert "--depth, --material, --diameter, --radial, --direction" in said.err
    assert "'long end mill'" in said.err
    shop.edit('name = "B"\ntool = "reference"\nteeth = 4', 'name = "B"\ntool = "reference"\nteeth = 3')
    said = check("--speed", "8700", "--depth", "1")
    assert "--teeth" in said.err
    assert "'reference'" in said.err
    shop.edit('name = "B"\ntool = "reference"', 'name = "B"\ntool = "another"')
    said = check("--speed", "8700", "--depth", "1")
    assert said.err.count("--tool, --material, --teeth, --diameter, --radial, --direction") == 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--speed", "0", "--depth", "1"), ("--speed 0", "above 0")),
        (("--speed", "nan", "--depth", "1"), ("--speed nan", "above 0")),
        (("--speed", "90000", "--depth", "1"), ("--speed 90000", "3000..24000 rpm")),
        (("--speed", "9000", "--depth", "-1"), ("--depth -1", "above 0")),
        (("--speed", "9000", "--depth", "1", "--teeth", "0"), ("--teeth 0", "above 0")),
        (
            ("--speed", "9000", "--depth", "1", "--diameter", "10"),
            ("radial_depth_mm=20", "tool_diameter_mm=10"),
        ),
        (("--speed", "9000", "--depth", "1", "--material", "42CrMo5"), ("42CrMo5", "'42CrMo4'")),
        (("--speed", "9000", "--depth", "0,5"), ("'--depth'", "0,5", "0.5")),
        (("--speed", "9000", "--depth", "1,500"), ("'--depth'", "1,500", "1.5 or 1500")),
        (("--speed", "18.000", "--depth", "1"), ("'--speed'", "18.000", "18 or 18000")),
        (("--speed", "1.2.3", "--depth", "1"), ("'--speed'", "1.2.3")),
    ],
)
def test_bad_numbers_of_a_cut_are_rejected(
    shop: Shop, check: Check, options: tuple[str, ...], message: tuple[str, ...]
) -> None:
    shop.tap_both()
    said = check(*options)
    assert (said.code, said.out) == (2, "")
    error = re.sub(r"[\s│]+", " ", said.err)
    assert all(fact in error for fact in message)


def test_a_machine_without_programs_evaluates_a_cut_that_is_specified_in_full(
    shop: Shop, check: Check, no_search: None
) -> None:
    shop.put("")
    shop.tap_both()
    said = check("--speed", "8700")
    assert "--depth, --material, --teeth, --diameter, --radial, --direction" in said.err
    cut = ("--tool", "reference", "--material", "aisi 4140", "--teeth", "4", "--diameter", "20", "--radial", "20")
    said = check("--speed", "8700", "--depth", "0.05", *cut, "--direction", "up", "--json")
    assert (said.code, [one["verdict"] for one in said.json["programs"]]) == (0, ["stable"])
    said = check("--speed", "8700", "--depth", "0.05", *cut[2:], "--direction", "up", "--tool", "never seen")
    assert (said.code, said.last) == (1, "1 program: 1 unknown")
