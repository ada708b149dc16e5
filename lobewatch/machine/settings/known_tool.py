"""What machine.toml says of a tool: its [[tool]], and where that is silent what its programs agree on."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from lobes import ToolMaterial
from lobewatch.machine.settings.cut_tables import CutTable
from lobewatch.machine.settings.machine_file import Machine

KEYS: Mapping[str, str] = MappingProxyType(
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
class KnownTool:
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


def known_tool(machine: Machine, name: str) -> KnownTool:
    """All that machine.toml says of a tool; a tool that it does not name at all has a name alone."""
    table = next((tool for tool in machine.tool if tool.name == name), None)
    programs = [program for program in machine.listed if program.tool == name]
    known: dict[str, Any] = {}
    for field, key in KEYS.items():
        values = {getattr(program, key) for program in programs}
        known[field] = next(iter(values)) if len(values) == 1 else None
    if table is None:
        return KnownTool(name, **known)
    own = {field: value for field in KEYS if (value := getattr(table, field, None)) is not None}
    return KnownTool(
        name,
        **known | own,
        tool_material=table.tool_material,
        cutting_speed_m_min=_range(table.cutting_speed_m_min),
        feed_per_tooth_mm=_range(table.feed_per_tooth_mm),
        max_speed_rpm=table.max_speed_rpm or math.inf,
    )


def feed_that_counts(machine: Machine, table: CutTable) -> float | None:
    """Feed per tooth (mm) that power and torque follow from: the cut's own, else the greatest of its [[tool]]."""
    tool = machine.tool_of(table)
    borne = None if tool is None else _range(tool.feed_per_tooth_mm)
    return table.feed_per_tooth_mm or (None if borne is None else borne[1])


def _range(value: float | tuple[float, ...] | None) -> tuple[float, float] | None:
    """A number alone is the greatest."""
    if value is None:
        return None
    return (value[0], value[1]) if isinstance(value, tuple) else (0.0, value)
