"""Cuts as machine.toml describes them: pitch, range of radial depth, corners."""

from __future__ import annotations

import math
from importlib import resources

import numpy as np
import pytest

from acquisition import DataError
from lobewatch.machine.settings.cut_tables import corner_engagement
from lobewatch.machine.settings.machine_file import parse_machine_file
from lobewatch.machine.settings.setting_questions import hash_programs

pytestmark = pytest.mark.quick

EXAMPLE = resources.files("sim_data").joinpath("surrogate_machine.toml").read_text("utf-8")
FIRST = "speed_rpm = 12600"


def with_first(*lines: str, radial: str = "20", more: str = "") -> str:
    """Return the example with more lines and another radial depth in its first program, and more at its end."""
    text = EXAMPLE.replace(FIRST, "\n".join((FIRST, *lines)), 1)
    head, _, tail = text.partition("[[program]]")
    return head + "[[program]]" + tail.replace("radial_depth_mm = 20", f"radial_depth_mm = {radial}", 1) + more


@pytest.mark.parametrize(("corner", "degrees"), [(12.0, 104.48), (10.0, 180.0), (8.0, 180.0), (1e6, 60.0)])
def test_engagement_in_a_corner_is_that_of_the_law_of_cosines(corner: float, degrees: float) -> None:
    """R 8, a 4: on the straight acos(1 - a / R) = 60 degrees."""
    assert math.degrees(corner_engagement(8.0, 4.0, corner)) == pytest.approx(degrees, abs=0.005)


@pytest.mark.parametrize(("tool", "radial", "corner"), [(8.0, 4.0, 12.0), (5.0, 1.0, 9.0), (10.0, 14.0, 31.0)])
def test_engagement_in_a_corner_is_that_of_a_tool_drawn_in_it(tool: float, radial: float, corner: float) -> None:
    """Points of the tool's edge that lie in material: between the old wall, corner - radial, and the new one."""
    angle = np.linspace(0, 2 * np.pi, 200_001)
    from_centre = np.hypot(corner - tool + tool * np.cos(angle), tool * np.sin(angle))
    front = np.sin(angle) > 0
    share = np.mean((from_centre > corner - radial) & front) * 2 * np.pi
    assert share == pytest.approx(corner_engagement(tool, radial, corner), abs=1e-4)


def test_a_range_and_a_corner_are_engagements_no_further_apart_than_15_degrees() -> None:
    for lines, radial, ends in (((), "[4, 12]", (0.2, 0.6)), (("corner_radius_mm = 15",), "5", (0.25, 0.625))):
        (program, *_) = parse_machine_file(with_first(*lines, radial=radial)).program
        immersions = np.array(program.immersions)
        assert (immersions[0], immersions[-1]) == pytest.approx(ends)
        steps = np.diff(np.arccos(1 - 2 * immersions))
        assert np.all((steps > 0) & (steps <= math.radians(15) + 1e-9))


@pytest.mark.parametrize("radial", ["5", "[5, 5]"])
def test_one_radial_depth_is_one_engagement(radial: str) -> None:
    assert parse_machine_file(with_first(radial=radial)).program[0].immersions == (0.25,)


def test_the_pitch_of_a_tool_is_that_of_its_programs_unless_they_say_otherwise() -> None:
    tool = 'tool = "long end mill"'
    text = with_first("pitch_deg = [80, 100, 80, 100]").replace('tool = "reference"\nteeth', f"{tool}\nteeth")
    text = text.replace('name = "long end mill"', 'name = "long end mill"\npitch_deg = [85, 95, 85, 95]')
    machine = parse_machine_file(text)
    own, of_tool, _ = (machine.build_cut(program) for program in machine.program)
    assert np.degrees(own.pitch) == pytest.approx([80, 100, 80, 100])
    assert np.degrees(of_tool.pitch) == pytest.approx([85, 95, 85, 95])
    assert machine.reference_cut is not None
    assert machine.build_cut(machine.reference_cut).pitch == ()
    changed = parse_machine_file(text.replace("[85, 95, 85, 95]", "[84, 96, 84, 96]"))
    assert hash_programs(machine) != hash_programs(changed)
    with pytest.raises(DataError, match=r"program 2, pitch_deg of tool 'long end mill': .*4 angles for 3 "):
        parse_machine_file(
            text.replace(f"{tool}\nteeth = 4", f"{tool}\nteeth = 3").replace("[80, 100, 80, 100]", "[80, 140, 140]")
        )


def test_a_reference_cut_has_a_feed() -> None:
    machine = parse_machine_file(EXAMPLE.replace("[reference_cut]", '[reference_cut]\nfeed = "y"'))
    (cut,) = machine.cuts("reference")["reference cut"]
    assert cut.feed_angle == pytest.approx(math.pi / 2)
