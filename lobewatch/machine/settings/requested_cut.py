"""Cuts that a user requests: by program name, or by values of their own."""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

from lobes import Cut
from lobewatch.machine.settings.cut_range import DEPTH_STEP_MM
from lobewatch.machine.settings.cut_tables import CutTable, ProgramTable
from lobewatch.machine.settings.drive_power import PowerReading, build_power_reading
from lobewatch.machine.settings.machine_file import REFERENCE_CUT, Machine
from lobewatch.machine.settings.tool_limits import PROGRAM_KEYS_BY_TOOL_FIELD, find_tool_properties

NamedTable = TypeVar("NamedTable", bound=CutTable)


@dataclass(frozen=True)
class CutSetting:
    """Speed, depth and tool of a cut that is about to be heard."""

    table: CutTable
    """Table of machine.toml."""
    material: str
    """Name of its material, the one of several that is listed first; empty where machine.toml gives the numbers."""
    program: str | None
    """Name of the program; None for the reference cut."""
    tool: str
    """Name of the tool in the spindle."""
    cut: Cut
    """Cut in SI units, the feed along x."""
    feed: str
    """Axis of the feed, "x" or "y", or "both"."""
    speed_rpm: float
    """Spindle speed as it is set (rpm)."""
    depth: float
    """Axial depth of cut (m)."""
    power: PowerReading | None = None
    """Power that the drive shows in it; None where nobody has read it."""

    @property
    def tooth_frequency(self) -> float:
        """Times a second that the cut repeats (Hz): teeth a second where they are evenly spaced."""
        return self.cut.repeats_per_turn * self.speed_rpm / 60

    def cut_entry_fields(self, speed_rpm: float) -> dict[str, Any]:
        """Fields of a `CutEntry` that follow from it and from the speed that was turned (rpm)."""
        feed = self.table.feed_per_tooth_mm
        return {
            "program": self.program,
            "tool": self.tool,
            "cut": self.cut,
            "coefficients": self.material,
            "feed": self.feed,
            "feed_per_tooth": None if feed is None else feed / 1e3,
            "commanded_rpm": self.speed_rpm,
            "speed_rpm": speed_rpm,
            "depth": self.depth,
            "power": None if self.power is None else self.power.at(speed_rpm),
        }


def find_cut_setting(
    machine: Machine, program: str, speed_rpm: float | None, depth_mm: float | None, power_kw: float | None = None
) -> CutSetting:
    """Setting of a program or "reference cut" at a speed and a depth; None: those of the program.

    power_kw: what the drive shows in it, more than in air. ValueError for a name, speed, depth or power that is none.
    """
    table = _find_cut_table(machine, program)
    for option, value, unit in (("--speed", speed_rpm, "rpm"), ("--depth", depth_mm, "mm")):
        if value is not None and not (math.isfinite(value) and value > 0):
            raise ValueError(f"{option} {value:g}: is not above 0; give the {option[2:]} that was cut with, in {unit}")
    preset = table if isinstance(table, ProgramTable) else None
    speed = preset.speed_rpm if speed_rpm is None and preset is not None else speed_rpm
    depth = preset.depth_mm if depth_mm is None and preset is not None else depth_mm
    if speed is None or depth is None:
        missing = "--speed" if speed is None else "--depth"
        raise ValueError(f"{missing} is missing: the {REFERENCE_CUT} has none of its own; give what was cut with")
    if table.flute_length_mm is not None and depth > table.flute_length_mm:
        raise ValueError(f"--depth {depth:g} mm is deeper than flute_length_mm={table.flute_length_mm:g}")
    tool = preset.tool if preset else machine.tap.tool
    name = preset.name if preset else None
    known, cut = machine.coefficients(table), machine.build_cut(table)
    setting = CutSetting(table, known.material, name, tool, cut, table.feed, float(speed), depth / 1e3)
    if power_kw is None:
        return setting
    return replace(setting, power=build_power_reading(power_kw, table, known, cut, machine.drive, speed, setting.depth))


def choose_cut(
    machine: Machine,
    program: str,
    cut: str,
    speed_rpm: float | None,
    depth_mm: float | None,
    power_kw: float | None = None,
) -> CutSetting:
    """Setting of a program, or of a cut with speed and depth of its own; ValueError where it is not one of both."""
    if bool(program) == bool(cut):
        names = ", ".join(map(repr, machine.cut_names)) or "none: add a [[program]] to machine.toml"
        raise ValueError(
            f"{'both' if cut else 'neither'} of --program and --cut: say which cut it is; there are {names}"
        )
    if cut and (speed_rpm is None or depth_mm is None):
        missing = "--speed" if speed_rpm is None else "--depth"
        raise ValueError(f"--cut {cut}: {missing} is missing; give speed and depth, or --program with those of its own")
    return find_cut_setting(machine, program or cut, speed_rpm, depth_mm, power_kw)


def _find_cut_table(machine: Machine, name: str) -> CutTable:
    tables: dict[str, CutTable] = {REFERENCE_CUT: machine.reference_cut} if machine.reference_cut else {}
    return find_by_name(tables | {table.name: table for table in machine.program}, name)


def find_by_name(tables: Mapping[str, NamedTable], name: str) -> NamedTable:
    """Table of this name, or the only one whose name begins so; ValueError where there is none, or are several."""
    fitting = [key for key in tables if key == name] or [key for key in tables if key.startswith(name)]
    if len(fitting) != 1:
        names = ", ".join(map(repr, fitting or tables)) or "none: add a [[program]] to machine.toml"
        why = "may be several: say more of its name" if fitting else "is not in machine.toml"
        raise ValueError(f"program {name!r} {why}; there are {names}")
    return tables[fitting[0]]


REQUIRED_CUT_OPTIONS = {
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
OPTIONAL_CUT_OPTIONS = {"feed_per_tooth_mm": "--feed-per-tooth"}
"""What may be known, likewise."""
COEFFICIENT_KEYS = {"tangential_n_per_mm2", "radial_n_per_mm2"}
"""Keys that stand for a material."""
PROGRAM_ONLY_KEYS = ("name", "speed_rpm", "depth_mm")
"""Keys that say nothing of the tool."""
SETTING_KEYS = ("speed_rpm", "depth_mm")
"""Keys that are asked for where a setting is."""
ENGAGEMENT_KEYS = ("radial_depth_mm", "direction", "corner_radius_mm", "feed", "wear", "thin")
"""Keys that say how it cuts: of no other program where a speed and a depth are asked for."""


def build_requested_program(machine: Machine, said: Mapping[str, Any]) -> ProgramTable:
    """The program that machine.toml would hold of a cut; said: values by the keys of OPTIONS, None where not said.

    What is not said is taken from the programs of the tool where they agree. ValueError that names all that is still
    missing, or what is none.
    """
    known = _collect_values(machine, said)
    _refuse_missing(machine, known, REQUIRED_CUT_OPTIONS)
    table = ProgramTable(name=f"{known['speed_rpm']:g} rpm, {known['depth_mm']:g} mm", **known)
    machine.coefficients(table)
    return table


def build_cut_without_setting(machine: Machine, said: Mapping[str, Any]) -> tuple[ProgramTable, bool]:
    """A cut whose speed and depth are asked for (those in it do not count), and whether it may be milled up or down.

    said and errors as of `build_requested_program`; without a radial depth it is a slot, without a direction both count.
    """
    known = {
        key: value
        for key, value in _collect_values(machine, said).items()
        if key not in (*SETTING_KEYS, *ENGAGEMENT_KEYS)
    }
    wanted = {
        key: option for key, option in REQUIRED_CUT_OPTIONS.items() if key not in (*SETTING_KEYS, *ENGAGEMENT_KEYS)
    }
    _refuse_missing(machine, known, wanted)
    diameter, radial, direction = known["tool_diameter_mm"], said.get("radial_depth_mm"), said.get("direction")
    own = {"radial_depth_mm": radial or diameter, "direction": direction or "down"}
    name = f"{known['tool']}, " + (f"{radial:g} of {diameter:g} mm" if radial else f"slot of {diameter:g} mm")
    table = ProgramTable(name=name, **known, **own, speed_rpm=machine.speed.high_rpm, depth_mm=DEPTH_STEP_MM)
    machine.coefficients(table)
    deepest, depth = table.deepest_mm, said.get("depth_mm")
    if depth is not None and depth > deepest:
        of = "the flutes" if table.flute_length_mm else "one diameter, which counts where no flute_length_mm is known"
        raise ValueError(f"--depth {depth:g}: is deeper than {of}; give up to {deepest:g} mm")
    return table, direction is None


def find_common_speed(machine: Machine, tool: str) -> float | None:
    """Speed (rpm) that the programs of a tool agree on; None where they do not, or there are none."""
    speeds = {program.speed_rpm for program in machine.program if program.tool == tool}
    return next(iter(speeds)) if len(speeds) == 1 else None


def _collect_values(machine: Machine, said: Mapping[str, Any]) -> dict[str, Any]:
    """What is said of a cut, and what the [[tool]] and the programs of its tool say, where they agree."""
    given = {key: value for key, value in said.items() if value is not None}
    _check_numbers(machine, given)
    tool = given.get("tool") or (
        _find_common_values(machine.all_programs).get("tool") if machine.all_programs else machine.tap.tool
    )
    known = _find_common_values([program for program in machine.all_programs if program.tool == tool])
    if "material" in given or not known.keys() >= COEFFICIENT_KEYS:
        known = {key: value for key, value in known.items() if key not in COEFFICIENT_KEYS}
    if tool is None:
        return known | given
    of_tool = find_tool_properties(machine, tool)
    own = {
        key: value
        for field, key in PROGRAM_KEYS_BY_TOOL_FIELD.items()
        if (value := getattr(of_tool, field)) is not None
    }
    return known | own | {"tool": tool} | given


def _refuse_missing(machine: Machine, known: Mapping[str, Any], wanted: Mapping[str, str]) -> None:
    """Ask for all that is not known; wanted: options by key."""
    missing = [option for key, option in wanted.items() if key not in known]
    if known.keys() >= COEFFICIENT_KEYS:
        missing = [option for option in missing if option != REQUIRED_CUT_OPTIONS["material"]]
    if missing:
        why = _explain_missing(machine, known.get("tool"))
        raise ValueError(f"{', '.join(missing)}: missing, and {why}; give them")


def _check_numbers(machine: Machine, given: Mapping[str, Any]) -> None:
    """Refuse a number that is none, and a speed that the machine does not turn at."""
    for key, option in (REQUIRED_CUT_OPTIONS | OPTIONAL_CUT_OPTIONS).items():
        value = given.get(key)
        if isinstance(value, int | float) and not (math.isfinite(value) and value > 0):
            raise ValueError(f"{option} {value:g}: is not above 0")
    speed, speeds = given.get("speed_rpm", machine.speed.low_rpm), machine.speed
    if not speeds.low_rpm <= speed <= speeds.high_rpm:
        raise ValueError(f"--speed {speed:g}: is outside [speed] {speeds.low_rpm:g}..{speeds.high_rpm:g} rpm")


def _find_common_values(programs: Sequence[ProgramTable]) -> dict[str, Any]:
    """What these programs have alike of their tool and its cut."""
    keys = [key for key in ProgramTable.__struct_fields__ if key not in PROGRAM_ONLY_KEYS]
    values = {key: {getattr(program, key) for program in programs} for key in keys}
    return {key: next(iter(alike)) for key, alike in values.items() if len(alike) == 1 and alike != {None}}


def _explain_missing(machine: Machine, tool: str | None) -> str:
    if tool is None:
        return "no tool is named whose programs could say them"
    named = {
        machine.tap.tool,
        *(table.name for table in machine.tool),
        *(program.tool for program in machine.all_programs),
    }
    if tool not in named:
        near = difflib.get_close_matches(tool, named, n=1)
        others = f"is {near[0]!r} meant?" if near else f"it knows {', '.join(map(repr, sorted(named)))}"
        return f"machine.toml knows no tool {tool!r} ({others})"
    if any(program.tool == tool for program in machine.all_programs):
        return f"the programs of tool {tool!r} do not agree on them"
    return f"no program runs with tool {tool!r}"
