"""A cut that is asked about without a [[program]]: what is not said of it is taken from the programs of its tool."""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping, Sequence
from typing import Any

from lobewatch.machine.settings.cut_range import MM
from lobewatch.machine.settings.cut_tables import ProgramTable
from lobewatch.machine.settings.known_tool import KEYS, known_tool
from lobewatch.machine.settings.machine_file import Machine

OPTIONS = {
    "speed_rpm": "--speed",
    "depth_mm": "--depth",
    "tool": "--tool",
    "material": "--material",
    "teeth": "--teeth",
    "tool_diameter_mm": "--diameter",
    "radial_depth_mm": "--radial",
    "direction": "--direction",
}
"""What must be known of a cut, by keys of a [[program]], with the option that says it."""
OPTIONAL = {"feed_per_tooth_mm": "--feed-per-tooth"}
"""What may be known, likewise."""
COEFFICIENTS = {"tangential_n_per_mm2", "radial_n_per_mm2"}
"""Keys that stand for a material."""
OF_A_PROGRAM = ("name", "speed_rpm", "depth_mm")
"""Keys that say nothing of the tool."""
ITS_SETTING = ("speed_rpm", "depth_mm")
"""Keys that are asked for where a setting is."""
OF_THE_CUT = ("radial_depth_mm", "direction", "corner_radius_mm", "feed", "wear", "thin")
"""Keys that say how it cuts: of no other program where a speed and a depth are asked for."""


def asked_program(machine: Machine, said: Mapping[str, Any]) -> ProgramTable:
    """The program that machine.toml would hold of a cut; said: values by the keys of OPTIONS, None where not said.

    What is not said is taken from the programs of the tool where they agree. ValueError that names all that is still
    missing, or what is none.
    """
    known = _known(machine, said)
    _refuse_missing(machine, known, OPTIONS)
    table = ProgramTable(name=f"{known['speed_rpm']:g} rpm, {known['depth_mm']:g} mm", **known)
    machine.coefficients(table)
    return table


def wanted_cut(machine: Machine, said: Mapping[str, Any]) -> tuple[ProgramTable, bool]:
    """A cut whose speed and depth are asked for (those in it do not count), and whether it may be milled up or down.

    said and errors as of `asked_program`; without a radial depth it is a slot, without a direction both count.
    """
    known = {key: value for key, value in _known(machine, said).items() if key not in (*ITS_SETTING, *OF_THE_CUT)}
    wanted = {key: option for key, option in OPTIONS.items() if key not in (*ITS_SETTING, *OF_THE_CUT)}
    _refuse_missing(machine, known, wanted)
    diameter, radial, direction = known["tool_diameter_mm"], said.get("radial_depth_mm"), said.get("direction")
    own = {"radial_depth_mm": radial or diameter, "direction": direction or "down"}
    name = f"{known['tool']}, " + (f"{radial:g} of {diameter:g} mm" if radial else f"slot of {diameter:g} mm")
    table = ProgramTable(name=name, **known, **own, speed_rpm=machine.speed.high_rpm, depth_mm=MM)
    machine.coefficients(table)
    deepest, depth = table.deepest_mm, said.get("depth_mm")
    if depth is not None and depth > deepest:
        of = "the flutes" if table.flute_length_mm else "one diameter, which counts where no flute_length_mm is known"
        raise ValueError(f"--depth {depth:g}: is deeper than {of}; give up to {deepest:g} mm")
    return table, direction is None


def present_speed(machine: Machine, tool: str) -> float | None:
    """Speed (rpm) that the programs of a tool agree on; None where they do not, or there are none."""
    speeds = {program.speed_rpm for program in machine.program if program.tool == tool}
    return next(iter(speeds)) if len(speeds) == 1 else None


def _known(machine: Machine, said: Mapping[str, Any]) -> dict[str, Any]:
    """What is said of a cut, and what the [[tool]] and the programs of its tool say, where they agree."""
    given = {key: value for key, value in said.items() if value is not None}
    _check_numbers(machine, given)
    tool = given.get("tool") or (_agreed(machine.listed).get("tool") if machine.listed else machine.tap.tool)
    known = _agreed([program for program in machine.listed if program.tool == tool])
    if "material" in given or not known.keys() >= COEFFICIENTS:
        known = {key: value for key, value in known.items() if key not in COEFFICIENTS}
    if tool is None:
        return known | given
    of_tool = known_tool(machine, tool)
    own = {key: value for field, key in KEYS.items() if (value := getattr(of_tool, field)) is not None}
    return known | own | {"tool": tool} | given


def _refuse_missing(machine: Machine, known: Mapping[str, Any], wanted: Mapping[str, str]) -> None:
    """Ask for all that is not known; wanted: options by key."""
    missing = [option for key, option in wanted.items() if key not in known]
    if known.keys() >= COEFFICIENTS:
        missing = [option for option in missing if option != OPTIONS["material"]]
    if missing:
        why = _why_missing(machine, known.get("tool"))
        raise ValueError(f"{', '.join(missing)}: missing, and {why}; give them")


def _check_numbers(machine: Machine, given: Mapping[str, Any]) -> None:
    """Refuse a number that is none, and a speed that the machine does not turn at."""
    for key, option in (OPTIONS | OPTIONAL).items():
        value = given.get(key)
        if isinstance(value, int | float) and not (math.isfinite(value) and value > 0):
            raise ValueError(f"{option} {value:g}: is not above 0")
    speed, speeds = given.get("speed_rpm", machine.speed.low_rpm), machine.speed
    if not speeds.low_rpm <= speed <= speeds.high_rpm:
        raise ValueError(f"--speed {speed:g}: is outside [speed] {speeds.low_rpm:g}..{speeds.high_rpm:g} rpm")


def _agreed(programs: Sequence[ProgramTable]) -> dict[str, Any]:
    """What these programs have alike of their tool and its cut."""
    keys = [key for key in ProgramTable.__struct_fields__ if key not in OF_A_PROGRAM]
    values = {key: {getattr(program, key) for program in programs} for key in keys}
    return {key: next(iter(alike)) for key, alike in values.items() if len(alike) == 1 and alike != {None}}


def _why_missing(machine: Machine, tool: str | None) -> str:
    if tool is None:
        return "no tool is named whose programs could say them"
    named = {machine.tap.tool, *(table.name for table in machine.tool), *(program.tool for program in machine.listed)}
    if tool not in named:
        near = difflib.get_close_matches(tool, named, n=1)
        others = f"is {near[0]!r} meant?" if near else f"it knows {', '.join(map(repr, sorted(named)))}"
        return f"machine.toml knows no tool {tool!r} ({others})"
    if any(program.tool == tool for program in machine.listed):
        return f"the programs of tool {tool!r} do not agree on them"
    return f"no program runs with tool {tool!r}"
