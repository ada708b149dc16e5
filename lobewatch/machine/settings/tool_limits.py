"""Limits of a tool: speed range, feed range and depth from its [[tool]] or published tables."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType
from typing import Any, NamedTuple

from lobes import (
    CutKind,
    PublishedRange,
    ToolMaterial,
    classify_cut,
    published_cutting_speed,
    published_feed_per_tooth,
    published_speed_of_any_tool,
)
from lobewatch.machine.settings.cut_tables import CutTable, ProgramTable
from lobewatch.machine.settings.machine_file import USER_SOURCE, Machine

PROGRAM_KEYS_BY_TOOL_FIELD: Mapping[str, str] = MappingProxyType(
    {
        "teeth": "teeth",
        "diameter_mm": "tool_diameter_mm",
        "helix_deg": "helix_deg",
        "flute_length_mm": "flute_length_mm",
        "pitch_deg": "pitch_deg",
        "feed_mm": "feed_per_tooth_mm",
    }
)
"""Fields that the programs of a tool know too, with the key that they have there."""


@dataclass(frozen=True)
class ToolProperties:
    """A tool; None where neither its [[tool]] nor its programs, all alike, say it."""

    name: str
    """Name of the tool."""
    teeth: int | None = None
    """Number of teeth."""
    diameter_mm: float | None = None
    """Diameter (mm)."""
    helix_deg: float | None = None
    """Helix angle (deg)."""
    flute_length_mm: float | None = None
    """Length of its flutes (mm)."""
    pitch_deg: tuple[float, ...] | None = None
    """Angles from tooth to tooth (deg); None for evenly spaced ones."""
    tool_material: ToolMaterial | None = None
    """Material of its edges."""
    cutting_speed_m_min: tuple[float, float] | None = None
    """Least and greatest speed of the edge that machine.toml gives it (m/min)."""
    feed_per_tooth_mm: tuple[float, float] | None = None
    """Least and greatest feed per tooth that machine.toml gives it (mm)."""
    max_speed_rpm: float = math.inf
    """Fastest speed that it may turn at (rpm), as of an unbalanced holder or an insert cutter."""
    feed_mm: float | None = None
    """Feed per tooth that its programs run with (mm)."""


def find_tool_properties(machine: Machine, name: str) -> ToolProperties:
    """All that machine.toml says of a tool; a tool that it does not name at all has a name alone."""
    table = next((tool for tool in machine.tool if tool.name == name), None)
    programs = [program for program in machine.all_programs if program.tool == name]
    known: dict[str, Any] = {}
    for field, key in PROGRAM_KEYS_BY_TOOL_FIELD.items():
        values = {getattr(program, key) for program in programs}
        known[field] = next(iter(values)) if len(values) == 1 else None
    if table is None:
        return ToolProperties(name, **known)
    own = {field: value for field in PROGRAM_KEYS_BY_TOOL_FIELD if (value := getattr(table, field, None)) is not None}
    return ToolProperties(
        name,
        **known | own,
        tool_material=table.tool_material,
        cutting_speed_m_min=_to_range(table.cutting_speed_m_min),
        feed_per_tooth_mm=_to_range(table.feed_per_tooth_mm),
        max_speed_rpm=table.max_speed_rpm or math.inf,
    )


def find_feed_per_tooth(machine: Machine, table: CutTable) -> float | None:
    """Feed per tooth (mm) that power and torque follow from: the cut's own, else the greatest of its [[tool]]."""
    tool = machine.find_tool(table)
    borne = None if tool is None else _to_range(tool.feed_per_tooth_mm)
    return table.feed_per_tooth_mm or (None if borne is None else borne[1])


def _to_range(value: float | tuple[float, ...] | None) -> tuple[float, float] | None:
    """A number alone is the greatest."""
    if value is None:
        return None
    return (value[0], value[1]) if isinstance(value, tuple) else (0.0, value)


class MissingToolData(StrEnum):
    """What must be known of a tool and is not: a key of [[tool]], or of the cut."""

    TOOL_MATERIAL = "tool_material"
    """Material of its edges."""
    MATERIAL = "material"
    """Group of ISO 513 of what is cut: Kt and Kr alone do not say it, nor does a [[material]] without iso_group."""
    CUTTING_SPEED = "cutting_speed_m_min"
    """Its cutting speed, where none is published for what it is and cuts."""
    FEED_PER_TOOTH = "feed_per_tooth_mm"
    """Its feed per tooth, likewise."""


class AllowedRange(NamedTuple):
    """Range that a tool bears."""

    low: float
    """Least value; 0 where there is none, as of what is only known not to be borne by any tool."""
    high: float
    """Greatest value."""
    source: str
    """Publications, or machine.toml."""


@dataclass(frozen=True)
class ToolLimits:
    """What a tool bears in a cut."""

    tool: ToolProperties
    """Tool, as machine.toml knows it."""
    cut: CutKind
    """Slot or side."""
    low_rpm: float
    """Slowest speed (rpm): of the spindle, or where the tool begins to cut well if the spindle is fast enough."""
    high_rpm: float
    """Fastest speed (rpm) of spindle and tool; below `low_rpm` where the spindle cannot turn so slowly."""
    cutting_speed_m_min: AllowedRange | None
    """Speeds of the edge (m/min); None where none is known."""
    feed_per_tooth_mm: AllowedRange | None
    """Feeds per tooth (mm); None where none is known."""
    deepest_mm: float
    """Greatest depth of cut of its flutes (mm); without a known length one diameter, or what it cuts now."""
    missing: tuple[MissingToolData, ...] = ()
    """Things that would have to be known to say it surely."""

    @property
    def is_empty(self) -> bool:
        """Whether no speed of the spindle is one that the tool bears."""
        return self.low_rpm > self.high_rpm

    @property
    def is_capped(self) -> bool:
        """Whether max_speed_rpm of its [[tool]] is what holds its fastest speed down, and not its edge."""
        return self.high_rpm == self.tool.max_speed_rpm

    @property
    def is_guessed(self) -> bool:
        """Whether its speeds are no more than those of the spindle, or of the fastest tool there is."""
        speed = self.cutting_speed_m_min
        return speed is None or (speed.low == 0 and speed.source != USER_SOURCE)


def find_tool_limits(machine: Machine, table: CutTable) -> ToolLimits:
    """What the tool of a cut bears in its material; the cut's own speed, depth and feed per tooth do not count.

    Slot or side by the radial depth on the straight. Speeds: [[tool]] cutting_speed_m_min, else what is published for
    its material and that of the tool; where the tool's is not known, or nothing is published of it, up to the fastest
    of all tools. Source of the published ranges: docs/tools.md.

    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as parent:
    ...     toml = make_machine_folder(Path(parent) / "mill-3", "surrogate_machine.toml")
    ...     machine = MachineFolder(toml.parent).machine
    >>> limits = find_tool_limits(machine, machine.program[0])
    >>> limits.cut, f"{limits.low_rpm:.0f} to {limits.high_rpm:.0f} rpm", [key.value for key in limits.unknown]
    ('slot', '3000 to 24000 rpm', ['tool_material', 'material'])
    """
    tool = find_tool_properties(machine, table.tool if isinstance(table, ProgramTable) else machine.tap.tool)
    cut = classify_cut(table.immersion)
    speed, feed = _find_speed_range(machine, table, tool, cut), _find_feed_range(machine, table, tool, cut)
    per_rpm = math.pi * table.tool_diameter_mm / 1e3
    fastest = min(machine.speed.high_rpm, tool.max_speed_rpm)
    low, high = (0.0, math.inf) if speed is None else (speed.low / per_rpm, speed.high / per_rpm)
    begin = low if low <= fastest else 0.0
    return ToolLimits(
        tool,
        cut,
        max(machine.speed.low_rpm, begin),
        min(fastest, high),
        speed,
        feed,
        _find_max_depth_mm(table, tool),
        tuple(_find_missing_data(machine, table, tool, speed, feed)),
    )


def _find_speed_range(machine: Machine, table: CutTable, tool: ToolProperties, cut: CutKind) -> AllowedRange | None:
    """Speeds of the edge (m/min)."""
    if tool.cutting_speed_m_min is not None:
        return AllowedRange(*tool.cutting_speed_m_min, USER_SOURCE)
    material = machine.coefficients(table)
    own = None if tool.tool_material is None else published_cutting_speed(material, tool.tool_material, cut)
    return _convert_published_range(own or published_speed_of_any_tool(material, cut), 60.0)


def _find_feed_range(machine: Machine, table: CutTable, tool: ToolProperties, cut: CutKind) -> AllowedRange | None:
    """Feeds per tooth (mm)."""
    if tool.feed_per_tooth_mm is not None:
        return AllowedRange(*tool.feed_per_tooth_mm, USER_SOURCE)
    if tool.tool_material is None:
        return None
    diameter = table.tool_diameter_mm / 1e3
    return _convert_published_range(
        published_feed_per_tooth(machine.coefficients(table), tool.tool_material, cut, diameter), 1e3
    )


def _convert_published_range(known: PublishedRange | None, unit: float) -> AllowedRange | None:
    if known is None:
        return None
    names = dict.fromkeys(source.partition(": ")[0] for source in known.sources)
    return AllowedRange(known.low * unit, known.high * unit, "; ".join(names))


def _find_max_depth_mm(table: CutTable, tool: ToolProperties) -> float:
    if table.flute_length_mm is None and tool.flute_length_mm is not None:
        return tool.flute_length_mm
    return table.deepest_mm


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
        yield from [MissingToolData.CUTTING_SPEED] if lacks_speed and (speed is None or speed.low == 0) else []
        yield from [MissingToolData.FEED_PER_TOOTH] if feed is None else []
