"""Tip compliance compared with the tool alone: closed forms, and the question that it raises."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from dsm import MATERIALS
from lobewatch.machine import Machine
from lobewatch.machine.settings.machine_file import parse_machine_file
from lobewatch.measurement.tool_compliance import (
    ToolAgreement,
    ToolBeam,
    check_tool_compliance,
    compare_with_tool,
    find_tool_beam,
)
from modal import Mode
from tests.lobewatch.conftest import Shop

pytestmark = pytest.mark.quick

TOOL = ToolBeam(0.016, 0.080, 0.080, "carbide")
HIGH = 5000.0
TOML = """
[machine]
name = "mill"

[[tool]]
name = "T1"
diameter_mm = 16
stick_out_mm = 80
tool_material = "carbide"
"""


def modes(stiffness: float) -> list[Mode]:
    """Return two modes of equal K with this static stiffness, and one in opposite phase."""
    return [Mode(900.0, 0.02, 2 * stiffness), Mode(1500.0, 0.02, 2 * stiffness), Mode(3000.0, 0.02, -1e9)]


def test_a_fluted_cantilever_has_the_compliance_of_its_effective_diameter() -> None:
    second_moment = math.pi * (0.8 * 0.016) ** 4 / 64
    assert TOOL.compliance == pytest.approx(0.080**3 / (3 * 580e9 * second_moment), rel=1e-12)


def test_a_shank_is_solid() -> None:
    solid = replace(TOOL, flute_length=0.0)
    assert TOOL.compliance / solid.compliance == pytest.approx(0.8**-4)
    half = replace(TOOL, flute_length=0.040)
    tip = np.linspace(0, 0.080, 200001)
    inertia = math.pi * np.where(tip < 0.040, 0.8 * 0.016, 0.016) ** 4 / 64
    bent = np.trapezoid(tip**2 / inertia, tip) / MATERIALS["carbide"].youngs_modulus
    assert half.compliance == pytest.approx(bent, rel=1e-4)


def test_the_natural_frequency_is_that_of_a_clamped_rod() -> None:
    rod = math.sqrt(580e9 / 14500.0) * 0.016 / 4
    assert TOOL.frequency == pytest.approx(0.5596 * rod / 0.080**2, rel=1e-3)


@pytest.mark.parametrize(
    ("ratio", "highest", "agreement"),
    [
        (0.78, HIGH, ToolAgreement.TOO_STIFF),
        (0.82, HIGH, ToolAgreement.AGREES),
        (3.6, HIGH, ToolAgreement.AGREES),
        (3.8, HIGH, ToolAgreement.TOO_SOFT),
        (0.5, 2000.0, ToolAgreement.UNKNOWN),
        (2.0, 2000.0, ToolAgreement.UNKNOWN),
        (3.8, 2000.0, ToolAgreement.TOO_SOFT),
    ],
)
def test_a_tip_is_compared_with_its_tool(ratio: float, highest: float, agreement: ToolAgreement) -> None:
    assert compare_with_tool(modes(1 / (ratio * TOOL.compliance)), TOOL, highest) is agreement


@pytest.mark.parametrize(("shank", "flutes"), [(None, 0.008), (None, 0.030), (0.006, 0.008)])
def test_a_small_cutter_on_a_thicker_shank_is_not_too_stiff(shank: float | None, flutes: float) -> None:
    """Cutter of 3 mm with 8 mm of flutes on a shank of 6 mm: from the tip 8 mm with 2.4 mm, then 22 mm with 6 mm."""
    fluted, whole = 0.008**3 / 0.0024**4, (0.030**3 - 0.008**3) / 0.006**4
    true = 64 * (fluted + whole) / (3 * math.pi * MATERIALS["carbide"].youngs_modulus)
    tool = ToolBeam(0.003, 0.030, flutes, "carbide", shank)
    assert tool.stiffest.compliance <= true * (1 + 1e-12)
    assert compare_with_tool(modes(1 / true), tool, 2e4) is ToolAgreement.AGREES
    assert compare_with_tool(modes(5 / true), tool, 2e4) is ToolAgreement.TOO_STIFF


def test_a_known_shank_is_the_stiffest() -> None:
    known = replace(TOOL, diameter=0.015, shank_diameter=0.015)
    assert known.stiffest == known
    assert TOOL.stiffest == TOOL
    assert replace(TOOL, diameter=0.015).stiffest.shank_diameter == 0.016
    text = TOML.replace("stick_out_mm = 80", "stick_out_mm = 80\nshank_diameter_mm = 20")
    assert find_tool_beam(parse_machine_file(text), "T1") == replace(TOOL, shank_diameter=0.020)


def test_nothing_is_known_without_tool_or_stiffness() -> None:
    free = Mode(900.0, 0.02, math.nan, relative_peak=1.0)
    assert compare_with_tool(modes(1e7), None, HIGH) is ToolAgreement.UNKNOWN
    assert compare_with_tool([free], TOOL, HIGH) is ToolAgreement.UNKNOWN


def test_the_keys_of_a_tool_make_the_beam() -> None:
    assert find_tool_beam(parse_machine_file(TOML), "T1") == TOOL


@pytest.mark.parametrize("key", ["diameter_mm = 16", "stick_out_mm = 80", 'tool_material = "carbide"'])
def test_a_missing_key_asks_nothing(key: str) -> None:
    machine = parse_machine_file(TOML.replace(key, ""))
    assert find_tool_beam(machine, "T1") is None
    assert check_tool_compliance(modes(1e9), machine, "T1", HIGH) is None


@pytest.mark.parametrize(
    ("old", "new"), [("stick_out_mm = 80", "stick_out_mm = 30"), ('"carbide"', '"PCD"'), ('"T1"', '"T2"')]
)
def test_a_tool_that_is_no_beam_of_known_material_is_unknown(old: str, new: str) -> None:
    assert find_tool_beam(parse_machine_file(TOML.replace(old, new)), "T1") is None


def test_the_stick_out_of_the_tapped_tool_is_that_of_the_tap_test() -> None:
    text = TOML.replace("[[tool]]", '[tap]\ntool = "T1"\nstick_out_mm = 60\n\n[[tool]]')
    beam = find_tool_beam(parse_machine_file(text), "T1")
    assert beam is not None
    assert beam.stick_out == 0.060


@pytest.fixture(scope="module")
def machine() -> Machine:
    return parse_machine_file(TOML)


@pytest.mark.parametrize(("ratio", "asked"), [(0.5, True), (2.0, False), (5.0, True)])
def test_a_tip_unlike_its_tool_is_asked_about(machine: Machine, ratio: float, asked: bool) -> None:
    remark = check_tool_compliance(modes(1 / (ratio * TOOL.compliance)), machine, "T1", HIGH)
    assert (remark is not None and remark.code == "tool-compliance") is asked


@pytest.mark.parametrize(("length", "asked"), [(110, True), (30, False)])
def test_a_tap_test_asks_until_it_is_accepted(shop: Shop, length: int, asked: bool) -> None:
    """1713 Hz with K 35 N/um: a carbide tool of 20 mm is alone at 22 N/um with 58 mm, at 3.2 N/um with 110 mm."""
    shop.put("")
    tool = f'[[tool]]\nname = "reference"\ndiameter_mm = 20\ntool_material = "carbide"\nstick_out_mm = {length}\n\n'
    shop.edit("# The spindle of the example", tool + "# The spindle of the example")
    tap_id = shop.tap(0, 1713.0)
    codes = [remark.code for remark in shop.logbook.history.rows[-1].questions]
    assert codes == (["tool-compliance"] if asked else [])
    shop.edit(f"stick_out_mm = {length}", "stick_out_mm = 31")
    assert not shop.logbook.history.rows[-1].questions
    shop.edit("stick_out_mm = 31", f"stick_out_mm = {length}")
    if asked:
        shop.folder.accept(tap_id, "tool-compliance")
        assert not shop.logbook.history.rows[-1].questions
