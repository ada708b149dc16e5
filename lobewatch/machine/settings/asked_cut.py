"""A cut that is asked about without a [[program]]: what is not said of it is taken from the programs of its tool."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from lobewatch.machine.settings.cut_tables import ProgramTable
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
COEFFICIENTS = {"tangential_n_per_mm2", "radial_n_per_mm2"}
"""Keys that stand for a material."""
OF_A_PROGRAM = ("name", "speed_rpm", "depth_mm")
"""Keys that say nothing of the tool."""


def asked_program(machine: Machine, said: Mapping[str, Any]) -> ProgramTable:
    """The program that machine.toml would hold of a cut; said: values by the keys of OPTIONS, None where not said.

    What is not said is taken from the programs of the tool where they agree. ValueError that names all that is still
    missing, or what is none.
    """
    given = {key: value for key, value in said.items() if value is not None}
    _check_numbers(machine, given)
    tool = given.get("tool") or _agreed(machine.program).get("tool")
    programs = [program for program in machine.program if program.tool == tool]
    known = _agreed(programs)
    if "material" in given or not known.keys() >= COEFFICIENTS:
        known = {key: value for key, value in known.items() if key not in COEFFICIENTS}
    known |= given
    missing = [option for key, option in OPTIONS.items() if key not in known]
    if known.keys() >= COEFFICIENTS:
        missing = [option for option in missing if option != OPTIONS["material"]]
    if missing:
        raise ValueError(f"{', '.join(missing)}: missing, and {_why_missing(tool, programs)}; give them")
    table = ProgramTable(name=f"{known['speed_rpm']:g} rpm, {known['depth_mm']:g} mm", **known)
    machine.coefficients(table)
    return table


def _check_numbers(machine: Machine, given: Mapping[str, Any]) -> None:
    """Refuse a number that is none, and a speed that the machine does not turn at."""
    for key, option in OPTIONS.items():
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


def _why_missing(tool: str | None, programs: Sequence[ProgramTable]) -> str:
    if tool is None:
        return "no tool is named whose programs could say them"
    return f"the programs of tool {tool!r} do not agree on them" if programs else f"no program runs with tool {tool!r}"
