"""Tool limits: own numbers, those of programs, published ones; missing data; drive; bad input."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest

from acquisition import DataError
from lobewatch.machine import CutTable, Machine, MissingToolData, ToolLimits, find_tool_limits, find_tool_properties
from lobewatch.machine.settings.drive_power import CutRange
from lobewatch.machine.settings.machine_file import parse_machine_file
from lobewatch.machine.settings.setting_questions import find_all_questions

pytestmark = pytest.mark.quick

HEAD = '[machine]\nname = "m"\n[speed]\nlow_rpm = 1000\nhigh_rpm = 24000\n'
STEEL = 'material = "42CrMo4"\n'
CARBIDE = 'tool_material = "carbide"\n'


def program(more: str = STEEL, name: str = "A", radial: float = 2.0, tool: str = "reference", feed: str = "") -> str:
    cut = f'speed_rpm = 3000\ndepth_mm = 2\nradial_depth_mm = {radial}\ndirection = "down"\n{more}{feed}'
    return f'[[program]]\nname = "{name}"\ntool = "{tool}"\nteeth = 4\ntool_diameter_mm = 18\n{cut}\n'


def tool(more: str = "", name: str = "reference") -> str:
    return f'[[tool]]\nname = "{name}"\n{more}\n'


def machine(*tables: str) -> Machine:
    return parse_machine_file(HEAD + "".join(tables))


def limits(*tables: str) -> ToolLimits:
    read = machine(*tables)
    return find_tool_limits(read, read.program[0])


def rpm(m_min: float, diameter_mm: float = 18.0) -> float:
    return m_min / (math.pi * diameter_mm / 1000)


def test_an_18_mm_carbide_tool_never_turns_at_21500_rpm_in_steel() -> None:
    for tables in ([tool(CARBIDE)], [tool('tool_material = "coated carbide"')], []):
        for radial in (0.5, 6.0, 18.0):
            known = limits(program(radial=radial), *tables)
            assert known.high_rpm <= rpm(300) < 21500
            assert known.low_rpm <= known.high_rpm


def test_speeds_and_feeds_of_the_table_at_the_diameter_of_the_tool() -> None:
    known = limits(program(), tool(CARBIDE))
    assert (known.low_rpm, known.high_rpm) == pytest.approx((rpm(74), rpm(161)))
    assert known.cut == "side"
    assert known.cutting_speed_m_min is not None
    assert known.feed_per_tooth_mm is not None
    assert known.cutting_speed_m_min[:2] == pytest.approx((74, 161))
    assert "Trade Tools" in known.cutting_speed_m_min.source
    assert known.feed_per_tooth_mm[:2] == pytest.approx((0.036, 0.18))
    assert known.missing == ()


def test_what_is_entered_comes_before_the_table() -> None:
    own = tool(CARBIDE + "cutting_speed_m_min = [100, 120]\nfeed_per_tooth_mm = 0.1\nmax_speed_rpm = 2000\n")
    known = limits(program(), own)
    assert (known.low_rpm, known.high_rpm) == pytest.approx((rpm(100), 2000))
    assert known.feed_per_tooth_mm == (0.0, 0.1, "machine.toml")
    assert limits(program(), tool("cutting_speed_m_min = 120")).low_rpm == 1000


def test_a_tool_of_which_nothing_is_published_is_no_faster_than_the_fastest_that_is() -> None:
    """Else it would be enough to say what a tool is made of to be sent anywhere: diamond in steel."""
    nobody_knows = limits(program(), tool('tool_material = "PCD"'))
    assert nobody_knows.is_guessed
    assert nobody_knows.high_rpm == limits(program()).high_rpm == pytest.approx(rpm(300))
    assert not limits(program(), tool('tool_material = "PCD"\ncutting_speed_m_min = 900')).is_guessed


def test_a_slot_allows_less_than_a_cut_at_the_side() -> None:
    assert limits(program(radial=18.0), tool(CARBIDE)).high_rpm == pytest.approx(rpm(82.5, 18.0), rel=0.01)


def test_a_spindle_too_slow_for_the_tool_may_turn_at_all_its_speeds() -> None:
    cut = program('material = "EN AW-6082"\n').replace("3000", "2000")
    slow = parse_machine_file(HEAD.replace("24000", "2600") + cut + tool(CARBIDE))
    assert slow.speed.high_rpm < rpm(148)
    known = find_tool_limits(slow, slow.program[0])
    assert (known.low_rpm, known.high_rpm) == (1000, 2600)


def test_a_spindle_too_fast_for_the_tool_leaves_nothing() -> None:
    fast = parse_machine_file(HEAD.replace("= 1000", "= 4000") + program().replace("3000", "5000") + tool(CARBIDE))
    known = find_tool_limits(fast, fast.program[0])
    assert known.is_empty
    reach = CutRange.of(fast, fast.program[0])
    assert reach.is_empty
    assert reach.speeds(0.01).size == 0
    assert not reach.contains(4000, 0.1)


@pytest.mark.parametrize(
    ("tables", "unknown"),
    [
        ([program()], [MissingToolData.TOOL_MATERIAL]),
        ([program("tangential_n_per_mm2 = 2000\nradial_n_per_mm2 = 500\n"), tool(CARBIDE)], [MissingToolData.MATERIAL]),
        ([program(), tool('tool_material = "PCD"')], [MissingToolData.CUTTING_SPEED, MissingToolData.FEED_PER_TOOTH]),
        ([program(), tool('tool_material = "PCD"\ncutting_speed_m_min = 900')], [MissingToolData.FEED_PER_TOOTH]),
        ([program(), tool("cutting_speed_m_min = 90\nfeed_per_tooth_mm = 0.1")], []),
    ],
)
def test_what_is_not_known_is_asked_by_the_key_that_says_it(tables: list[str], unknown: list[MissingToolData]) -> None:
    assert list(limits(*tables).missing) == unknown


def test_a_material_of_ones_own_says_its_group() -> None:
    mine = '[[material]]\nname = "mine"\ntangential_n_per_mm2 = 2000\nradial_n_per_mm2 = 500\n'
    cut = program('material = "mine"\n')
    assert limits(cut, mine, tool(CARBIDE)).missing == (MissingToolData.MATERIAL,)
    assert limits(cut, mine + 'iso_group = "P"\n', tool(CARBIDE)).high_rpm == pytest.approx(rpm(161))


def test_a_tool_is_what_its_table_says_and_else_what_its_programs_agree_on() -> None:
    read = machine(program(feed="feed_per_tooth_mm = 0.1"), program(name="B", feed="feed_per_tooth_mm = 0.2"))
    known = find_tool_properties(read, "reference")
    assert (known.teeth, known.diameter_mm, known.feed_mm, known.tool_material) == (4, 18, None, None)
    read = machine(program(), tool("flute_length_mm = 12\nhelix_deg = 35\nteeth = 4\n" + CARBIDE))
    known = find_tool_properties(read, "reference")
    assert (known.diameter_mm, known.flute_length_mm, known.helix_deg) == (18, 12, 35)
    assert find_tool_properties(read, "nobody's").teeth is None
    assert find_tool_limits(read, read.program[0]).deepest_mm == 12


def test_the_drive_allows_less_depth_the_faster_it_turns_beyond_its_corner() -> None:
    drive = "[drive]\npower_kw = 4\ntorque_nm = 20\n"
    read = machine(drive, program(radial=18.0, feed="feed_per_tooth_mm = 0.1"), tool("cutting_speed_m_min = 200"))
    reach = CutRange.of(read, read.program[0])
    slow, fast = reach.depth_limits(np.array([1500.0, 3000.0]))
    steel = read.coefficients(read.program[0])
    torque = 4 * 0.018 / (4 * math.pi) * (steel.tangential * 0.1e-3 * 2 + steel.tangential_edge * math.pi)
    assert slow == pytest.approx(20 / torque * 1e3)
    assert fast == pytest.approx(4000 / (2 * math.pi * 3000 / 60) / torque * 1e3)


def test_no_depth_is_chosen_that_would_be_asked_about_but_one_that_is_asked_for_may_be_evaluated() -> None:
    """Below 0.002 and beyond 2 diameters of 18 mm."""
    read = machine(program(), tool(CARBIDE))
    reach = CutRange.of(read, read.program[0])
    shallow = CutRange.of(read, msgspec.structs.replace(read.program[0], tool_diameter_mm=31.0))
    assert [reach.round_down_depth(depth) for depth in (0.04, 0.07, 0.12)] == [0.0, 0.05, 0.1]
    assert [shallow.round_down_depth(depth) for depth in (0.06, 0.07, 0.12)] == [0.0, 0.0, 0.1]
    assert shallow.contains(shallow.low_rpm, 0.05)


def test_a_reference_cut_is_that_of_the_tapped_tool() -> None:
    cut = '[reference_cut]\nteeth = 4\nradial_depth_mm = 18\ntool_diameter_mm = 18\ndirection = "down"\n' + STEEL
    read = machine(cut, tool(CARBIDE))
    assert isinstance(read.reference_cut, CutTable)
    assert find_tool_limits(read, read.reference_cut).high_rpm == pytest.approx(rpm(82.5), rel=0.01)


def test_the_drive_counts_with_the_greatest_feed_of_the_tool_where_the_program_has_none() -> None:
    drive = "[drive]\npower_kw = 1\n"
    read = machine(drive, program(), tool("feed_per_tooth_mm = [0.02, 0.2]"))
    said = machine(drive, program(feed="feed_per_tooth_mm = 0.2"))
    speeds = np.array([2000.0])
    ranges = [CutRange.of(known, known.program[0]) for known in (read, said)]
    assert ranges[0].depth_limits(speeds) == pytest.approx(ranges[1].depth_limits(speeds))
    assert ranges[0].depth_limits(speeds)[0] < 18


@pytest.mark.parametrize(
    ("more", "facts"),
    [
        ("cutting_speed_m_min = [200, 90]", r"cutting_speed_m_min=\[200, 90\] .*smallest, largest"),
        ("feed_per_tooth_mm = -0.1", "feed_per_tooth_mm: .*> 0.0.* -0.1"),
        ("max_speed = 3", "'max_speed'.* 'max_speed_rpm'"),
        ("masses = [{ position_mm = 1, mass_kg = 1 }]", "masses .*segments"),
        ("pitch_deg = [90, 90, 90]\nteeth = 4", "pitch"),
    ],
)
def test_a_mistake_in_a_tool_is_reported(more: str, facts: str) -> None:
    with pytest.raises(DataError, match=f"tool 1.*{facts}"):
        machine(tool(more))


@pytest.mark.parametrize(("key", "value"), [("teeth", 5), ("diameter_mm", 9), ("flute_length_mm", 50)])
def test_a_program_that_contradicts_its_tool_is_asked_about(key: str, value: float) -> None:
    flutes = "flute_length_mm = 40\n"
    read = machine(program(feed=flutes), tool(f"{key} = {value}"))
    (asked,) = find_all_questions(read)
    assert asked.fault == "settings-contradict"
    assert f"{key} = {value} of [[tool]] 'reference'" in asked.reason
    assert find_all_questions(machine(program(feed=flutes), tool("teeth = 4\ndiameter_mm = 18\n" + flutes))) == []


def test_a_cut_deeper_than_the_flutes_of_its_tool_is_rejected() -> None:
    with pytest.raises(DataError, match=r"program 1: depth_mm=2 .*flute_length_mm=1 .*'reference'"):
        machine(program(), tool("flute_length_mm = 1"))


def test_a_tool_without_a_shape_has_no_model() -> None:
    read = machine(tool(CARBIDE, "long"))
    assert read.modelled_tools == []
    with pytest.raises(DataError, match="segments"):
        read.find_modelled_tool("long")
