"""What a tool bears in a material: its speeds and feeds per tooth, from its [[tool]] or from published tables."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

from lobes import CutKind, PublishedRange, cut_kind, cutting_speed, fastest_of_all, feed_per_tooth
from lobewatch.machine.settings.cut_tables import CutTable, ProgramTable
from lobewatch.machine.settings.known_tool import KnownTool, known_tool
from lobewatch.machine.settings.machine_file import OWN, Machine


class Unknown(StrEnum):
    """What must be known of a tool and is not: a key of [[tool]], or of the cut."""

    TOOL_MATERIAL = "tool_material"
    """Material of its edges."""
    MATERIAL = "material"
    """Group of ISO 513 of what is cut: Kt and Kr alone do not say it, nor does a [[material]] without iso_group."""
    CUTTING_SPEED = "cutting_speed_m_min"
    """Its cutting speed, where none is published for what it is and cuts."""
    FEED_PER_TOOTH = "feed_per_tooth_mm"
    """Its feed per tooth, likewise."""


class Borne(NamedTuple):
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

    tool: KnownTool
    """Tool, as machine.toml knows it."""
    cut: CutKind
    """Slot or side."""
    low_rpm: float
    """Slowest speed (rpm): of the spindle, or where the tool begins to cut well if the spindle is fast enough."""
    high_rpm: float
    """Fastest speed (rpm) of spindle and tool; below `low_rpm` where the spindle cannot turn so slowly."""
    cutting_speed_m_min: Borne | None
    """Speeds of the edge (m/min); None where none is known."""
    feed_per_tooth_mm: Borne | None
    """Feeds per tooth (mm); None where none is known."""
    deepest_mm: float
    """Greatest depth of cut of its flutes (mm); without a known length one diameter, or what it cuts now."""
    unknown: tuple[Unknown, ...] = ()
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
        return speed is None or (speed.low == 0 and speed.source != OWN)


def tool_limits(machine: Machine, table: CutTable) -> ToolLimits:
    """What the tool of a cut bears in its material; the cut's own speed, depth and feed per tooth do not count.

    Slot or side by the radial depth on the straight. Speeds: [[tool]] cutting_speed_m_min, else what is published for
    its material and that of the tool; where the tool's is not known, or nothing is published of it, up to the fastest
    of all tools. Source of the published ranges: docs/tools.md.

    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as parent:
    ...     toml = make_machine_folder(Path(parent) / "mill-3", "surrogate_machine.toml")
    ...     machine = MachineFolder(toml.parent).machine
    >>> limits = tool_limits(machine, machine.program[0])
    >>> limits.cut, f"{limits.low_rpm:.0f} to {limits.high_rpm:.0f} rpm", [key.value for key in limits.unknown]
    ('slot', '3000 to 24000 rpm', ['tool_material', 'material'])
    """
    tool = known_tool(machine, table.tool if isinstance(table, ProgramTable) else machine.tap.tool)
    cut = cut_kind(table.immersion)
    speed, feed = _speed(machine, table, tool, cut), _feed(machine, table, tool, cut)
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
        _deepest_mm(table, tool),
        tuple(_unknown(machine, table, tool, speed, feed)),
    )


def _speed(machine: Machine, table: CutTable, tool: KnownTool, cut: CutKind) -> Borne | None:
    """Speeds of the edge (m/min)."""
    if tool.cutting_speed_m_min is not None:
        return Borne(*tool.cutting_speed_m_min, OWN)
    material = machine.coefficients(table)
    own = None if tool.tool_material is None else cutting_speed(material, tool.tool_material, cut)
    return _published(own or fastest_of_all(material, cut), 60.0)


def _feed(machine: Machine, table: CutTable, tool: KnownTool, cut: CutKind) -> Borne | None:
    """Feeds per tooth (mm)."""
    if tool.feed_per_tooth_mm is not None:
        return Borne(*tool.feed_per_tooth_mm, OWN)
    if tool.tool_material is None:
        return None
    diameter = table.tool_diameter_mm / 1e3
    return _published(feed_per_tooth(machine.coefficients(table), tool.tool_material, cut, diameter), 1e3)


def _published(known: PublishedRange | None, unit: float) -> Borne | None:
    if known is None:
        return None
    names = dict.fromkeys(source.partition(": ")[0] for source in known.sources)
    return Borne(known.low * unit, known.high * unit, "; ".join(names))


def _deepest_mm(table: CutTable, tool: KnownTool) -> float:
    if table.flute_length_mm is None and tool.flute_length_mm is not None:
        return tool.flute_length_mm
    return table.deepest_mm


def _unknown(
    machine: Machine, table: CutTable, tool: KnownTool, speed: Borne | None, feed: Borne | None
) -> Iterator[Unknown]:
    lacks_speed, lacks_feed = tool.cutting_speed_m_min is None, feed is None
    if not (lacks_speed or lacks_feed):
        return
    if tool.tool_material is None:
        yield Unknown.TOOL_MATERIAL
    if not machine.coefficients(table).iso_group:
        yield Unknown.MATERIAL
    elif tool.tool_material is not None:
        yield from [Unknown.CUTTING_SPEED] if lacks_speed and (speed is None or speed.low == 0) else []
        yield from [Unknown.FEED_PER_TOOTH] if feed is None else []
