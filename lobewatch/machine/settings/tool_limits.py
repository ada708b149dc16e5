"""Limits of a tool: speed range, feed range and depth from its [[tool]] or published tables."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, NamedTuple

import lobes
from lobes import CutKind, PublishedRange, ToolMaterial
from lobewatch.machine.settings.cut_tables import CutTable, ProgramTable
from lobewatch.machine.settings.machine_file import USER_SOURCE, Machine

PROGRAM_KEYS_BY_TOOL_FIELD = {name: name for name in ("teeth", "helix_deg", "flute_length_mm", "pitch_deg")}
PROGRAM_KEYS_BY_TOOL_FIELD |= {"diameter_mm": "tool_diameter_mm", "feed_mm": "feed_per_tooth_mm"}
"""Fields of a tool that its programs have too, with the key in a [[program]]."""


@dataclass(frozen=True)
class ToolProperties:
    """Tool as described by its [[tool]] or by all of its programs; None for unknown values."""

    name: str
    """Name of the tool."""
    teeth: int | None = None
    """Number of teeth."""
    diameter_mm: float | None = None
    """Diameter (mm)."""
    helix_deg: float | None = None
    """Helix angle (deg)."""
    flute_length_mm: float | None = None
    """Flute length (mm)."""
    pitch_deg: tuple[float, ...] | None = None
    """Angles from tooth to tooth (deg); None for equal pitch."""
    tool_material: ToolMaterial | None = None
    """Material of the cutting edges."""
    cutting_speed_m_min: tuple[float, float] | None = None
    """Lowest and highest cutting speed of machine.toml (m/min)."""
    feed_per_tooth_mm: tuple[float, float] | None = None
    """Lowest and highest feed per tooth of machine.toml (mm)."""
    max_speed_rpm: float = math.inf
    """Speed limit (rpm), for example of an unbalanced holder."""
    feed_mm: float | None = None
    """Feed per tooth of its programs (mm)."""


def find_tool_properties(machine: Machine, name: str) -> ToolProperties:
    """Return the properties of a tool in machine.toml.

    Parameters
    ----------
    machine
        Machine with its tools and programs.
    name
        Name of the tool.

    Returns
    -------
    ToolProperties
        Properties of the tool; only the name if machine.toml does not mention it.
    """
    table = machine.tool_table(name)
    programs = [program for program in machine.all_programs if program.tool == name]
    shared = find_common_values(programs)
    common: dict[str, Any] = {field: shared.get(key) for field, key in PROGRAM_KEYS_BY_TOOL_FIELD.items()}
    if table is None:
        return ToolProperties(name, **common)
    own = {field: value for field in PROGRAM_KEYS_BY_TOOL_FIELD if (value := getattr(table, field, None)) is not None}
    own |= {key: _to_range(getattr(table, key)) for key in ("cutting_speed_m_min", "feed_per_tooth_mm")}
    own |= {"tool_material": table.tool_material, "max_speed_rpm": table.max_speed_rpm or math.inf}
    return ToolProperties(name, **common | own)


def find_common_values(programs: Sequence[ProgramTable]) -> dict[str, Any]:
    """Return the values that all programs have in common, by key, except name, speed and depth."""
    keys = [key for key in ProgramTable.__struct_fields__ if key not in ("name", "speed_rpm", "depth_mm")]
    values = {key: {getattr(program, key) for program in programs} for key in keys}
    return {key: next(iter(same)) for key, same in values.items() if len(same) == 1 and same != {None}}


def find_feed_per_tooth(machine: Machine, table: CutTable) -> float | None:
    """Return the feed per tooth (mm) of a cut, else the largest of its [[tool]]; None if unknown."""
    tool = machine.find_tool(table)
    allowed = None if tool is None else _to_range(tool.feed_per_tooth_mm)
    return table.feed_per_tooth_mm or (allowed and allowed[1])


def _to_range(value: float | tuple[float, ...] | None) -> tuple[float, float] | None:
    """Return a range; a single number is the upper limit."""
    if value is None:
        return None
    return (value[0], value[1]) if isinstance(value, tuple) else (0.0, value)


class MissingToolData(StrEnum):
    """Unknown property of a tool: a key of its [[tool]] or of the cut."""

    TOOL_MATERIAL = "tool_material"
    """Material of the cutting edges."""
    MATERIAL = "material"
    """ISO 513 group of the workpiece; Kt and Kr do not imply it."""
    CUTTING_SPEED = "cutting_speed_m_min"
    """Cutting speed, if none is published."""
    FEED_PER_TOOTH = "feed_per_tooth_mm"
    """Feed per tooth, if none is published."""


class AllowedRange(NamedTuple):
    """Range that a tool allows."""

    low: float
    """Lower limit; 0 without one."""
    high: float
    """Upper limit."""
    source: str
    """Publications, or machine.toml."""


@dataclass(frozen=True)
class ToolLimits:
    """Limits of a tool in a cut."""

    tool: ToolProperties
    """Tool with its known properties."""
    cut: CutKind
    """Kind of the cut, slot or side."""
    low_rpm: float
    """Lowest speed (rpm) of spindle and tool."""
    high_rpm: float
    """Highest speed (rpm) of spindle and tool; below `low_rpm` if no speed is allowed."""
    cutting_speed_m_min: AllowedRange | None
    """Allowed cutting speeds (m/min); None if unknown."""
    feed_per_tooth_mm: AllowedRange | None
    """Allowed feeds per tooth (mm); None if unknown."""
    deepest_mm: float
    """Flute length (mm); without one the diameter or the present depth."""
    missing: tuple[MissingToolData, ...] = ()
    """Properties that are unknown and would make the limits certain."""

    @property
    def is_empty(self) -> bool:
        """True if the tool allows no speed of the spindle."""
        return self.low_rpm > self.high_rpm

    @property
    def is_guessed(self) -> bool:
        """True if the speeds are only those of the spindle or of the fastest tool."""
        speed = self.cutting_speed_m_min
        return speed is None or (speed.low == 0 and speed.source != USER_SOURCE)


def find_tool_limits(machine: Machine, table: CutTable) -> ToolLimits:
    """Return the limits of the tool of a cut in its material.

    Speeds come from [[tool]] cutting_speed_m_min, else from published values for both materials; without them, up to
    the fastest of all tools. Sources of the published ranges: docs/tools.md.

    Parameters
    ----------
    machine
        Machine with its tools and materials.
    table
        Cut; its speed, depth and feed per tooth are not used.

    Returns
    -------
    ToolLimits
        Ranges of speed and feed, largest depth, and what is unknown.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as parent:
    ...     toml = make_machine_folder(Path(parent) / "mill-3", "surrogate_machine.toml")
    ...     machine = MachineFolder(toml.parent).machine
    >>> limits = find_tool_limits(machine, machine.program[0])
    >>> limits.cut, f"{limits.low_rpm:.0f} to {limits.high_rpm:.0f} rpm", [key.value for key in limits.missing]
    ('slot', '3000 to 24000 rpm', ['tool_material', 'material'])
    """
    tool = find_tool_properties(machine, table.tool if isinstance(table, ProgramTable) else machine.tap.tool)
    cut = lobes.classify_cut(table.immersion)
    speed, feed = _find_speed_range(machine, table, tool, cut), _find_feed_range(machine, table, tool, cut)
    per_rpm = math.pi * table.tool_diameter_mm / 1e3
    fastest = min(machine.speed.high_rpm, tool.max_speed_rpm)
    low, high = (0.0, math.inf) if speed is None else (speed.low / per_rpm, speed.high / per_rpm)
    speeds = max(machine.speed.low_rpm, low if low <= fastest else 0.0), min(fastest, high)
    missing = tuple(_find_missing_data(machine, table, tool, speed, feed))
    flutes = tool.flute_length_mm if table.flute_length_mm is None else None
    return ToolLimits(tool, cut, *speeds, speed, feed, flutes or table.deepest_mm, missing)


def _find_speed_range(machine: Machine, table: CutTable, tool: ToolProperties, cut: CutKind) -> AllowedRange | None:
    """Return the allowed cutting speeds (m/min)."""
    if tool.cutting_speed_m_min is not None:
        return AllowedRange(*tool.cutting_speed_m_min, USER_SOURCE)
    material = machine.coefficients(table)
    own = None if tool.tool_material is None else lobes.published_cutting_speed(material, tool.tool_material, cut)
    return _convert_published_range(own or lobes.published_speed_of_any_tool(material, cut), 60.0)


def _find_feed_range(machine: Machine, table: CutTable, tool: ToolProperties, cut: CutKind) -> AllowedRange | None:
    """Return the allowed feeds per tooth (mm)."""
    if tool.feed_per_tooth_mm is not None:
        return AllowedRange(*tool.feed_per_tooth_mm, USER_SOURCE)
    if tool.tool_material is None:
        return None
    diameter = table.tool_diameter_mm / 1e3
    feed = lobes.published_feed_per_tooth(machine.coefficients(table), tool.tool_material, cut, diameter)
    return _convert_published_range(feed, 1e3)


def _convert_published_range(published: PublishedRange | None, unit: float) -> AllowedRange | None:
    if published is None:
        return None
    names = dict.fromkeys(source.partition(": ")[0] for source in published.sources)
    return AllowedRange(published.low * unit, published.high * unit, " and ".join(names))


def _find_missing_data(
    machine: Machine, table: CutTable, tool: ToolProperties, speed: AllowedRange | None, feed: AllowedRange | None
) -> Iterator[MissingToolData]:
    lacks_speed, lacks_feed = tool.cutting_speed_m_min is None, feed is None
    if not (lacks_speed or lacks_feed):
        return
    if tool.tool_material is None:
        yield MissingToolData.TOOL_MATERIAL
    if not machine.coefficients(table).iso_group:
        yield MissingToolData.MATERIAL
    elif tool.tool_material is not None:
        if lacks_speed and (speed is None or speed.low == 0):
            yield MissingToolData.CUTTING_SPEED
        if lacks_feed:
            yield MissingToolData.FEED_PER_TOOTH
