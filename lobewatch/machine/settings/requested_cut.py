"""Cuts that a user requests: by program name, or by values of their own."""

import difflib
import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, TypeVar

from lobes import Cut
from lobewatch.machine.settings.cut_tables import CutTable, ProgramTable
from lobewatch.machine.settings.display_units import LENGTH
from lobewatch.machine.settings.drive_power import DEPTH_STEP_MM, PowerReading, build_power_reading
from lobewatch.machine.settings.machine_file import REFERENCE_CUT, Machine
from lobewatch.machine.settings.tool_limits import PROGRAM_KEYS_BY_TOOL_FIELD, find_common_values, find_tool_properties

NamedTable = TypeVar("NamedTable", bound=CutTable)

SETTING_KEYS = ("speed_rpm", "depth_mm")
"""Keys of the setting of a program."""
REQUIRED_CUT_KEYS = (*SETTING_KEYS, *("tool", "material", "teeth", "tool_diameter_mm", "radial_depth_mm", "direction"))
"""Keys of a [[program]] that a requested cut needs."""
COEFFICIENT_KEYS = {"tangential_n_per_mm2", "radial_n_per_mm2"}
"""Keys that replace a material."""
ENGAGEMENT_KEYS = ("radial_depth_mm", "direction", "corner_radius_mm", "feed", "wear", "wear_land_um", "thin")
"""Keys of the engagement, which other programs do not share with a cut whose setting is requested."""


@dataclass(frozen=True)
class CutSetting:
    """Speed, depth and tool of a cut that is about to be recorded."""

    table: CutTable
    """Table of machine.toml."""
    material: str
    """Name of its material; empty if machine.toml gives the coefficients."""
    program: str | None
    """Name of the program; None for the reference cut."""
    tool: str
    """Name of the tool in the spindle."""
    cut: Cut
    """Cut in SI units, feed along x."""
    feed: str
    """Axis of the feed, "x" or "y", or "both"."""
    speed_rpm: float
    """Spindle speed as set (rpm)."""
    depth: float
    """Axial depth of cut (m)."""
    power: PowerReading | None = None
    """Power shown by the drive; None if it was not read."""

    @property
    def tooth_frequency(self) -> float:
        """Tooth passing frequency (Hz), or the repetition frequency of unequal pitches."""
        return self.cut.repeats_per_turn * self.speed_rpm / 60

    def cut_entry_fields(self, speed_rpm: float) -> dict[str, Any]:
        """Return the fields of a `CutEntry` that follow from the setting and the true speed (rpm)."""
        feed, power = self.table.feed_per_tooth_mm, None if self.power is None else self.power.at(speed_rpm)
        fields = {name: getattr(self, name) for name in ("program", "tool", "cut", "feed", "depth")}
        fields |= {"feed_per_tooth": None if feed is None else feed / 1e3, "coefficients": self.material}
        fields["cut"] = replace(self.cut, process_damping=0.0)  # test cuts teach it
        return fields | {"commanded_rpm": self.speed_rpm, "speed_rpm": speed_rpm, "power": power}


def find_cut_setting(
    machine: Machine, program: str, speed_rpm: float | None, depth_mm: float | None, power_kw: float | None = None
) -> CutSetting:
    """Return the setting of a program or the "reference cut"; speed and depth default to those of the program.

    power_kw is the power shown in the cut less that in air. Raises ValueError for an unknown name or an invalid value.
    """
    table = find_by_name(machine.cut_tables, program)
    if speed_rpm is not None and not _is_positive(speed_rpm):
        raise ValueError(f"ProgramTable.speed_rpm {speed_rpm:g} is not above 0. Give the speed of the cut in rpm.")
    if depth_mm is not None and not _is_positive(depth_mm):
        cure = f"Give the depth of the cut in {LENGTH.unit}."
        raise ValueError(f"ProgramTable.depth_mm {LENGTH.number(depth_mm, 'g')} is not above 0. {cure}")
    preset = table if isinstance(table, ProgramTable) else None
    speed = preset.speed_rpm if speed_rpm is None and preset is not None else speed_rpm
    depth = preset.depth_mm if depth_mm is None and preset is not None else depth_mm
    if speed is None or depth is None:
        missing = f"ProgramTable.{'speed_rpm' if speed is None else 'depth_mm'}"
        raise ValueError(f"{missing} is missing. Give this value, because the {REFERENCE_CUT} has no default for it.")
    if table.flute_length_mm is not None and depth > table.flute_length_mm:
        raise ValueError(
            f"ProgramTable.depth_mm {LENGTH.text(depth)} is deeper than flute_length_mm={table.flute_length_mm:g}"
        )
    program_name, tool = (preset.name, preset.tool) if preset else (None, machine.tap.tool)
    material, cut = machine.coefficients(table).material, machine.build_cut(table)
    setting = CutSetting(table, material, program_name, tool, cut, table.feed, float(speed), depth / 1e3)
    if power_kw is None:
        return setting
    return replace(setting, power=build_power_reading(power_kw, machine, table, speed, setting.depth))


def choose_cut(
    machine: Machine, program: str, cut: str, speed: float | None, depth: float | None, power_kw: float | None = None
) -> CutSetting:
    """Return the setting of a program, or of a cut with speed (rpm) and depth (mm); ValueError unless one is named."""
    if program and cut:
        raise ValueError("choose_cut.program cannot be used with choose_cut.cut. Leave out one of the two.")
    if not program and not cut:
        known = _choose_one_of(machine.cut_tables)
        raise ValueError(f"neither choose_cut.program nor choose_cut.cut given. {known}.")
    if cut and (speed is None or depth is None):
        key = "speed_rpm" if speed is None else "depth_mm"
        raise ValueError(f"choose_cut.cut {cut} needs ProgramTable.{key}. Give both, or use choose_cut.program.")
    return find_cut_setting(machine, program or cut, speed, depth, power_kw)


def _is_positive(value: float) -> bool:
    return math.isfinite(value) and value > 0


def find_by_name(tables: Mapping[str, NamedTable], name: str) -> NamedTable:
    """Return the table of a name or of its only match by prefix; ValueError if there is none or several."""
    matches = [key for key in tables if key == name] or [key for key in tables if key.startswith(name)]
    if len(matches) != 1:
        problem = f"matches {len(matches)} names" if matches else "is not in machine.toml"
        raise ValueError(f"program {name!r} {problem}. {_choose_one_of(matches or tables)}.")
    return tables[matches[0]]


def _choose_one_of(names: Collection[str]) -> str:
    """Return the remedy for a missing or unknown name."""
    return f"Choose one of {', '.join(map(repr, names))}" if names else "Add a [[program]] to machine.toml"


def build_requested_program(machine: Machine, values: Mapping[str, Any]) -> ProgramTable:
    """Build the [[program]] of a cut from its values by key; None or a missing key is not given.

    Missing values come from the other programs of the tool if they agree. Raises ValueError that names all that is
    missing or invalid.
    """
    complete = _complete_values(machine, values)
    _reject_missing(machine, complete, REQUIRED_CUT_KEYS)
    table = ProgramTable(name=f"{complete['speed_rpm']:g} rpm, {LENGTH.text(complete['depth_mm'])}", **complete)
    machine.coefficients(table)
    return table


class OpenCut(NamedTuple):
    """Cut whose speed and depth are requested."""

    table: ProgramTable
    """Cut, with any speed and depth."""
    is_any_direction: bool
    """True if it may be milled up or down."""
    is_reference: bool
    """True if its material comes from [reference_cut]."""


def build_cut_without_setting(machine: Machine, values: Mapping[str, Any]) -> OpenCut:
    """Build a cut whose speed and depth are requested.

    Values and errors as in `build_requested_program`. The default is a slot, in both directions. A material that
    neither the values nor the programs of the tool give comes from [reference_cut], with its direction.
    """
    excluded = (*SETTING_KEYS, *ENGAGEMENT_KEYS)
    complete = {key: value for key, value in _complete_values(machine, values).items() if key not in excluded}
    required = [key for key in REQUIRED_CUT_KEYS if key not in excluded]
    is_only_material_missing = [key for key in required if key not in complete] == ["material"]
    reference = _find_reference_material(machine, complete) if is_only_material_missing else {}
    complete |= {key: value for key, value in reference.items() if key != "direction"}
    _reject_missing(machine, complete, required)
    diameter, radial = complete["tool_diameter_mm"], values.get("radial_depth_mm")
    direction = values.get("direction") or reference.get("direction")
    engagement = {"radial_depth_mm": radial or diameter, "direction": direction or "down"}
    width = f"{LENGTH.number(radial, 'g')} of" if radial else "slot of"
    name = f"{complete['tool']}, {width} {LENGTH.text(diameter)}"
    engagement |= {"speed_rpm": machine.speed.high_rpm, "depth_mm": DEPTH_STEP_MM}
    table = ProgramTable(name=name, **complete | engagement)
    machine.coefficients(table)
    deepest, depth = table.deepest_mm, values.get("depth_mm")
    if depth is not None and depth > deepest:
        of = "the flutes" if table.flute_length_mm else "one diameter, the limit without flute_length_mm"
        text = f"ProgramTable.depth_mm {LENGTH.number(depth, 'g')} is deeper than {of}"
        raise ValueError(f"{text}. Give up to {LENGTH.text(deepest)}.")
    return OpenCut(table, direction is None, bool(reference))


def _find_reference_material(machine: Machine, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return material and direction of [reference_cut]; empty without one or if the cut has its coefficients."""
    cut = machine.reference_cut
    if cut is None or values.keys() >= COEFFICIENT_KEYS:
        return {}
    material = {key: getattr(cut, key) for key in ("material", *COEFFICIENT_KEYS)}
    known = {key: value for key, value in material.items() if value is not None}
    return known | {"direction": cut.direction}


def find_common_speed(machine: Machine, tool: str) -> float | None:
    """Return the speed (rpm) of all programs of a tool; None if they differ or there are none."""
    speeds = {program.speed_rpm for program in machine.program if program.tool == tool}
    return speeds.pop() if len(speeds) == 1 else None


def _complete_values(machine: Machine, values: Mapping[str, Any]) -> dict[str, Any]:
    """Add the values of the [[tool]], and those that all programs of the tool have in common."""
    given = {key: value for key, value in values.items() if value is not None}
    _check_numbers(machine, given)
    programs = machine.all_programs
    tool = given.get("tool") or (find_common_values(programs).get("tool") if programs else machine.tap.tool)
    common = find_common_values([program for program in programs if program.tool == tool])
    replaced = {"process_damping_n_per_m"} if "material" in given else set()
    if "material" in given or not common.keys() >= COEFFICIENT_KEYS:
        replaced |= COEFFICIENT_KEYS
    common = {key: value for key, value in common.items() if key not in replaced}
    if tool is None:
        return common | given
    properties = find_tool_properties(machine, tool)
    by_key = {key: getattr(properties, field) for field, key in PROGRAM_KEYS_BY_TOOL_FIELD.items()}
    return common | {key: value for key, value in by_key.items() if value is not None} | {"tool": tool} | given


def _reject_missing(machine: Machine, values: Mapping[str, Any], required: Collection[str]) -> None:
    replaced = {"material"} if values.keys() >= COEFFICIENT_KEYS else set()
    missing = [f"ProgramTable.{key}" for key in required if key not in values and key not in replaced]
    if missing:
        raise ValueError(f"missing: {', '.join(missing)}. {_complete_missing(machine, values.get('tool'))}")


def _check_numbers(machine: Machine, given: Mapping[str, Any]) -> None:
    for key in (*REQUIRED_CUT_KEYS, "feed_per_tooth_mm"):
        value = given.get(key)
        if isinstance(value, int | float) and not _is_positive(value):
            raise ValueError(f"ProgramTable.{key} {value:g} is not above 0")
    speed, speeds = given.get("speed_rpm", machine.speed.low_rpm), machine.speed
    if not speeds.low_rpm <= speed <= speeds.high_rpm:
        limits = f"{speeds.low_rpm:g}..{speeds.high_rpm:g} rpm"
        raise ValueError(f"ProgramTable.speed_rpm {speed:g} is outside [speed] {limits}")


def _complete_missing(machine: Machine, tool: str | None) -> str:
    """Return the remedy for missing values, with the reason why no program gives them."""
    if tool is None:
        return "Give these values, or name a tool with programs."
    with_programs = {program.tool for program in machine.all_programs}
    names = {machine.tap.tool, *(table.name for table in machine.tool), *with_programs}
    if tool not in names:
        near = difflib.get_close_matches(tool, names, n=1)
        known = f"Did you mean {near[0]!r}?" if near else f"Known tools: {', '.join(map(repr, sorted(names)))}."
        return f"Tool {tool!r} is not in machine.toml. {known}"
    if tool in with_programs:
        return f"Give these values, because the programs of tool {tool!r} differ."
    return f"Give these values, because no program uses tool {tool!r}."
