"""A factor of 1000 in any number of machine.toml is rejected, questioned, or in the table of docs/plausible.md."""

from __future__ import annotations

import copy
import re
import tomllib
from collections.abc import Iterator
from importlib import resources
from pathlib import Path
from typing import Any

import pytest

from acquisition import DataError
from lobewatch.machine.settings.machine_file import Machine, parse_machine_file
from lobewatch.machine.settings.setting_questions import (
    find_all_questions,
    find_program_questions,
    find_template_bearings,
)
from lobewatch.machine.settings.toml import TablePath, TomlTable, edit_toml, find_plausible_ranges

ROOT = Path(__file__).parents[4]
UNSEEN = set(re.findall(r"^\| `([^`]+)` \|", (ROOT / "docs/plausible.md").read_text("utf-8"), re.MULTILINE))
TEMPLATE = resources.files("sim_data").joinpath("new_machine.toml").read_text("utf-8")
FULL = re.sub(r"^# (?=[\w.]+ = |\[|    \{|\])", "", TEMPLATE, flags=re.MULTILINE)
"""The template with all its comments that are settings taken in."""
OWN = """
[[material]]
name = "C"
tangential_n_per_mm2 = 1500
radial_n_per_mm2 = 500
tangential_edge_n_per_mm = 20
radial_edge_n_per_mm = 30
"""
LONG = {"tool_diameter_mm": 12, "flute_length_mm": 26}
"""Keys of a program for the [[tool]] of the template."""
Place = tuple[str | int, ...]


def full_tables() -> dict[str, Any]:
    """Tables with every number that machine.toml may hold."""
    tables = tomllib.loads(
        re.sub(r'^material = "42CrMo4".*\n|^mqtt = .*\n|^corner_radius_mm.*\n', "", FULL, flags=re.MULTILINE)
    )
    tables.pop("notify", None)
    tables["tap"]["position_mm"] = 20
    tables["machine"]["name"] = "m"
    tables["material"] += tomllib.loads(OWN)["material"]
    for cut in (tables["reference_cut"], *tables["program"]):
        cut |= {"tangential_n_per_mm2": 1400, "radial_n_per_mm2": 500}
    program = tables["program"][0]
    program |= {
        "radial_depth_mm": 5,
        "helix_deg": 30,
        "feed_per_tooth_mm": 0.1,
        "flute_length_mm": 40,
        "tool": "reference",
    }
    for name, material in (("our", "our 7075"), ("c", "C")):
        tables["program"].append({key: value for key, value in program.items() if not key.endswith("n_per_mm2")})
        tables["program"][-1] |= {"name": name, "material": material}
    tables["daq"]["channel"][0] |= {"gain": 1, "skew_us": 10}
    tables["spindle"]["bearings"][0] |= {"stiffness_n_per_um": 300.0}
    tables["spindle"]["bearing_stiffness_n_per_um"] = 450.0
    tables["program"].append({**program, "name": "long", "tool": tables["tool"][0]["name"], **LONG})
    return tables


TABLES = full_tables()


def numbers(value: Any, place: Place = ()) -> Iterator[tuple[Place, float]]:
    """Every number with its place."""
    if isinstance(value, dict | list):
        for key, inner in value.items() if isinstance(value, dict) else enumerate(value):
            yield from numbers(inner, (*place, key))
    elif isinstance(value, int | float) and not isinstance(value, bool) and value != 0:
        yield place, value


def text_of(tables: dict[str, Any]) -> str:
    """Return tables as TOML, inline below the first level."""
    return "\n".join(f"{key} = {_inline(value)}" for key, value in tables.items())


def _inline(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_inline(inner)}" for key, inner in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(_inline, value)) + "]"
    return f'"{value}"' if isinstance(value, str) else str(value).lower()


def slipped(place: Place, factor: float) -> dict[str, Any]:
    tables = copy.deepcopy(TABLES)
    parent: Any = tables
    for key in place[:-1]:
        parent = parent[key]
    value = parent[place[-1]] * factor
    parent[place[-1]] = round(value) if isinstance(parent[place[-1]], int) and value >= 1 and factor > 1 else value
    return tables


def seen(tables: dict[str, Any]) -> bool:
    """Return whether a machine.toml is rejected or questioned."""
    try:
        machine = parse_machine_file(text_of(tables))
    except DataError:
        return True
    return bool(find_all_questions(machine))


def short(place: Place) -> str:
    """Key with its table."""
    return ".".join(str(part) for part in place if isinstance(part, str))


def test_nothing_is_asked_where_all_is_as_it_should_be() -> None:
    assert find_all_questions(parse_machine_file(text_of(TABLES))) == []


@pytest.mark.parametrize("factor", [1000.0, 0.001])
def test_every_slip_of_1000_is_rejected_or_asked_about(factor: float) -> None:
    assert {short(place) for place, _ in numbers(TABLES) if not seen(slipped(place, factor))} == set()


def test_the_page_lists_the_ranges_that_a_slip_of_1000_may_stay_in() -> None:
    ranges = [entry for table in TomlTable.__subclasses__() for entry in find_plausible_ranges(table).items()]
    wide = {key for key, (low, high) in ranges if high / low >= 1000}
    assert wide == UNSEEN


def machine_of(**changes: Any) -> Machine:
    """Return the full machine with changes to its first program."""
    tables = copy.deepcopy(TABLES)
    tables["program"][0] |= changes
    return parse_machine_file(text_of(tables))


@pytest.mark.parametrize(
    ("changes", "key", "fact"),
    [
        ({"tangential_n_per_mm2": 1.4}, "tangential_n_per_mm2", "200 to 6000"),
        ({"tangential_n_per_mm2": 6500, "radial_n_per_mm2": 2000}, "tangential_n_per_mm2", "200 to 6000"),
        ({"radial_n_per_mm2": 1900}, "radial_n_per_mm2", "1.36 times tangential_n_per_mm2"),
        ({"tool_diameter_mm": 10}, "tool_diameter_mm", " 20 of program 'our'"),
        ({"tool_diameter_mm": 0.787, "radial_depth_mm": 0.7}, "tool_diameter_mm", " 20 of program 'our'"),
        ({"tool_diameter_mm": 5, "radial_depth_mm": 4}, "stick_out_mm", "16 diameters of 5 mm"),
        ({"teeth": 5, "pitch_deg": [72, 72, 72, 72, 72]}, "teeth", " 4 of program 'our'"),
    ],
)
def test_what_is_not_plausible_is_asked_of_the_program_that_rests_on_it(
    changes: dict[str, Any], key: str, fact: str
) -> None:
    machine = machine_of(**changes)
    asked = find_program_questions(machine, machine.program[0], on_model=False)
    assert any(question.key == key and fact in question.remark.text for question in asked), asked


def test_an_answer_is_kept_for_this_value_alone() -> None:
    machine = machine_of(tangential_n_per_mm2=6500, radial_n_per_mm2=2000)
    (asked,) = find_program_questions(machine, machine.program[0], on_model=False)
    tables = copy.deepcopy(TABLES)
    tables["machine"]["accepted"] = [asked.statement]
    for value, count in ((6500, 0), (6600, 1)):
        tables["program"][0] |= {"tangential_n_per_mm2": value, "radial_n_per_mm2": 2000}
        accepting = parse_machine_file(text_of(tables))
        assert len(find_program_questions(accepting, accepting.program[0], on_model=False)) == count


def test_what_the_template_holds_is_nobodys() -> None:
    tables = copy.deepcopy(TABLES)
    tables["spindle"]["bearing_stiffness_n_per_um"] = 500.0
    tables["program"][0] |= {"tangential_n_per_mm2": 700, "radial_n_per_mm2": 250}
    machine = parse_machine_file(text_of(tables))
    assert [question.fault for question in find_all_questions(machine)] == ["setting-guessed"]
    guessed = find_template_bearings(machine)
    assert guessed is not None
    assert guessed.key == "bearing_stiffness_n_per_um"
    assert "bearing_stiffness_n_per_um = 500.0" in TEMPLATE
    assert "tangential_n_per_mm2 = 700\nradial_n_per_mm2 = 250" in TEMPLATE


def test_accepted_lines_are_written_and_written_again() -> None:
    once = edit_toml("[machine]\nname = 'm'\n", TablePath("machine"), {"accepted": ["[tap] a = 1"]})
    twice = edit_toml(once, TablePath("machine"), {"accepted": ["[tap] a = 1", "b = 2"]})
    assert twice == '[machine]\nname = \'m\'\naccepted = ["[tap] a = 1", "b = 2"]\n'
