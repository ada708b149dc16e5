"""Tool limits in `check`, `lobes` and `suggest`: nothing beyond is recommended, programs beyond get a remark."""

from __future__ import annotations

import math
from typing import Any

import msgspec
import numpy as np
import pytest

from lobewatch.cuts.learning.program_learning import find_next_cut
from lobewatch.machine import find_tool_limits
from lobewatch.machine.settings.drive_power import CutRange
from lobewatch.verdicts.program_case import SpindleAtSpeed
from lobewatch.verdicts.program_remarks import missing_tool_remarks, tool_limit_remarks
from lobewatch.verdicts.recommendation import find_stable_pockets

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""
CARBIDE = '[[tool]]\nname = "reference"\ntool_material = "carbide"\n'
KT_AND_KR = "tangential_n_per_mm2 = 2000\nradial_n_per_mm2 = 500"
COATED = CARBIDE.replace("carbide", "coated carbide")
FASTEST = 180 / (math.pi * 0.018)
"""Speed (rpm) of 180 m/min with 18 mm, the most that coated carbide bears in a slot of steel."""


def steel(speed: float, depth: float = 0.5, radial: float = 18, more: str = "", tool: str = CARBIDE) -> str:
    """Build a program in 42CrMo4 with a tool of 18 mm."""
    return f"""
[[program]]
name = "steel"
tool = "reference"
teeth = 4
tool_diameter_mm = 18
radial_depth_mm = {radial}
direction = "down"
material = "42CrMo4"
helix_deg = 30
speed_rpm = {speed:g}
depth_mm = {depth:g}
{more}

{tool}
"""


@pytest.fixture
def mill(shop: Shop) -> Shop:
    """Build a spindle that turns slowly enough for steel."""
    shop.edit("low_rpm = 3000", "low_rpm = 1000")
    return shop


@pytest.fixture
def tapped(shop: Shop) -> Shop:
    """Build a spindle of 3000 rpm and more: steel leaves it few speeds."""
    shop.tap_both()
    return shop


def test_an_18_mm_carbide_tool_is_nowhere_sent_to_21500_rpm_in_steel(tapped: Shop) -> None:
    tapped.put(steel(21500, depth=2, tool=COATED))
    logbook = tapped.logbook
    (verdict,) = logbook.verdicts()
    assert "outside-tool-limits" in [remark.code for remark in verdict.remarks]
    advice = logbook.advice(verdict)
    pockets = find_stable_pockets(verdict.program, verdict.assembly, logbook.machine)
    assert "tool-not-described" not in [remark.code for remark in advice.remarks]
    settings = [setting for setting in (advice.best, advice.deepest_here, *pockets) if setting is not None]
    assert settings
    for setting in settings:
        assert 3000 <= setting.window_rpm[0] <= setting.speed_rpm <= setting.window_rpm[1] <= FASTEST
    suggested = find_next_cut(verdict.program, verdict.assembly, logbook.machine, [], 5).suggestion
    assert suggested is not None
    assert suggested.speed_rpm <= FASTEST


def test_what_cuts_have_taught_of_the_force_leaves_the_limits_as_they_are(tapped: Shop) -> None:
    tapped.put(steel(3100, tool=COATED))
    machine = tapped.folder.machine
    taught = SpindleAtSpeed(n_cuts=3, tangential=1500.0, radial=500.0)
    known = msgspec.structs.replace(
        machine.program[0], tangential_n_per_mm2=taught.tangential, radial_n_per_mm2=taught.radial
    )
    assert machine.coefficients(known).tangential == 1500e6
    reaches = [CutRange.of(machine, table) for table in (machine.program[0], known)]
    assert reaches[0].high_rpm == reaches[1].high_rpm <= FASTEST


@pytest.mark.parametrize(
    ("program", "facts"),
    [
        (steel(6000, radial=3.6), ("6000 rpm", "339 m/min", "74 to 161 m/min")),
        (steel(1100, radial=3.6), ("1100 rpm", "62.2 m/min", "74 to 161 m/min")),
        (steel(6000, radial=3.6, tool=""), ("fastest tool", "18 mm", "side", "42CrMo4")),
        (steel(2000), ("carbide", "18 mm", "slot", "42CrMo4")),
        (steel(2000, radial=3.6, tool=CARBIDE + "max_speed_rpm = 1900"), ("2000 rpm", "max_speed_rpm = 1900")),
        (
            steel(2000, radial=3.6, more="feed_per_tooth_mm = 0.5"),
            ("feed_per_tooth_mm = 0.5", "0.036 to 0.18 mm"),
        ),
        (
            steel(2000, radial=3.6, more="feed_per_tooth_mm = 0.01"),
            ("feed_per_tooth_mm = 0.01", "0.036 to 0.18 mm"),
        ),
    ],
)
def test_a_program_outside_is_remarked_with_what_is_allowed(mill: Shop, program: str, facts: tuple[str, ...]) -> None:
    mill.put(program)
    machine = mill.folder.machine
    (remark,) = tool_limit_remarks(machine.program[0], machine)
    assert (remark.code, remark.about) == ("outside-tool-limits", "steel")
    assert all(fact in remark.text for fact in facts)
    assert "[[tool]] 'reference'" in remark.cure
    keys = ("feed_per_tooth_mm", "max_speed_rpm")
    (key,) = [key for key in keys if key in remark.text] or ["cutting_speed_m_min"]
    assert [key for key in (*keys, "cutting_speed_m_min") if key in remark.cure] == [key]


def test_a_tool_that_was_never_tapped_is_remarked_too(mill: Shop) -> None:
    mill.put(steel(6000))
    (verdict,) = mill.logbook.verdicts()
    assert [remark.code for remark in verdict.remarks] == ["not-checked", "outside-tool-limits"]


def test_a_program_inside_is_not(mill: Shop) -> None:
    mill.put(steel(2000, radial=3.6, more="feed_per_tooth_mm = 0.1"))
    machine = mill.folder.machine
    assert list(tool_limit_remarks(machine.program[0], machine)) == []


def test_a_tool_that_allows_no_speed_of_the_spindle_is_sent_nowhere(tapped: Shop) -> None:
    tapped.put(steel(3000, depth=9, tool=CARBIDE.replace("carbide", "HSS")))
    logbook = tapped.logbook
    (verdict,) = logbook.verdicts()
    advice = logbook.advice(verdict)
    assert (advice.best, advice.deepest_here) == (None, None)
    assert find_stable_pockets(verdict.program, verdict.assembly, logbook.machine) == []
    following = find_next_cut(verdict.program, verdict.assembly, logbook.machine, [], 5)
    assert following.suggestion is None
    assert following.cut_range.is_empty


@pytest.mark.parametrize(
    ("program", "words"),
    [
        (steel(2000, tool=""), "fastest tool"),
        (steel(2000).replace('material = "42CrMo4"', KT_AND_KR), "speeds of the spindle"),
        (steel(2000, tool=CARBIDE.replace("carbide", "PCD")), "fastest tool"),
        (steel(2000), ""),
        (steel(2000, tool=CARBIDE.replace("carbide", "PCD") + "cutting_speed_m_min = 300"), ""),
    ],
)
def test_advice_asks_for_what_is_not_known_of_the_tool(mill: Shop, program: str, words: str) -> None:
    mill.put(program)
    machine = mill.folder.machine
    asked = list(missing_tool_remarks(machine.program[0], find_tool_limits(machine, machine.program[0])))
    assert [(remark.code, remark.about) for remark in asked] == [("tool-not-described", "reference")] * bool(words)
    assert all(words in remark.text and "cutting_speed_m_min" in remark.cure for remark in asked)


def test_flutes_and_helix_of_the_tool_hold_for_a_program_that_does_not_say_them(mill: Shop) -> None:
    straight, twisted = (
        steel(2000, tool=CARBIDE + more).replace("helix_deg = 30\nspeed", "speed") for more in ("", "helix_deg = 30\n")
    )
    lags = []
    for program in (straight, twisted, steel(2000)):
        mill.put(program)
        machine = mill.folder.machine
        lags.append(machine.build_cut(machine.program[0]).helix_lag)
    assert lags[0] == 0
    assert lags[1] == lags[2] > 0
    mill.put(steel(2000, tool=CARBIDE + "flute_length_mm = 6"))
    machine = mill.folder.machine
    assert np.all(CutRange.of(machine, machine.program[0]).depth_limits(np.array([2000.0])) == 6)
