"""Remarks on what the tool of a program bears: where the program is outside, and what is not known of the tool."""

from __future__ import annotations

import math
from collections.abc import Iterator

from acquisition import Remark
from lobewatch.machine import Machine, ProgramTable, ToolLimits, Unknown, tool_limits
from lobewatch.machine.settings.cut_range import CutRange

TO_SAY = {
    Unknown.TOOL_MATERIAL: "tool_material in its [[tool]]",
    Unknown.MATERIAL: "material in the program (Kt and Kr alone are of no group of ISO 513)",
}
"""What is asked for beside the cutting speed, where that is not known."""
OWN_KEYS = (Unknown.CUTTING_SPEED, Unknown.FEED_PER_TOOTH)
"""Keys of [[tool]] that stand for what its maker says."""


def outside_tool(table: ProgramTable, machine: Machine) -> Iterator[Remark]:
    """Speed and feed per tooth of a program that its tool does not bear, with what it does and the source."""
    limits = tool_limits(machine, table)
    if not limits.low_rpm <= table.speed_rpm <= limits.high_rpm:
        reach = CutRange(machine, table, limits)
        cure = "choose another tool" if limits.is_empty else f"turn at {reach.low_rpm:g} to {reach.high_rpm:g} rpm"
        is_over = table.speed_rpm > limits.tool.max_speed_rpm
        own = "correct max_speed_rpm" if is_over else "enter what its maker says as cutting_speed_m_min"
        yield _remark(table, _speed(table, limits), f"{cure}, or {own}")
    feed, borne = table.feed_per_tooth_mm, limits.feed_per_tooth_mm
    if feed is not None and borne is not None and not borne.low <= feed <= borne.high:
        text = f"feed_per_tooth_mm = {feed:g} is outside {_range(borne.low, borne.high)} mm, {_bears(table, limits)}"
        cure = "feed within that, or enter what its maker says as feed_per_tooth_mm"
        yield _remark(table, f"{text} ({borne.source})", cure)


def not_described(table: ProgramTable, limits: ToolLimits) -> Iterator[Remark]:
    """Question for what advice on a program would have to know of its tool."""
    if limits.is_guessed:
        whose = "of the spindle" if limits.cutting_speed_m_min is None else "up to those of the fastest tool"
        asked = " and ".join(text for unknown, text in TO_SAY.items() if unknown in limits.unknown)
        own = [key for key in OWN_KEYS if key is Unknown.CUTTING_SPEED or key in limits.unknown]
        cure = "; or ".join(filter(None, [asked, f"{' and '.join(own)} in its [[tool]]"]))
        text = f"what the tool bears is not known: speeds {whose} are advised"
        yield Remark("tool-not-described", table.tool, text, f"write {cure}")


def _remark(table: ProgramTable, text: str, cure: str) -> Remark:
    return Remark("outside-tool-limits", table.name, text, f"{cure} in [[tool]] {table.tool!r}")


def _speed(table: ProgramTable, limits: ToolLimits) -> str:
    if table.speed_rpm > limits.tool.max_speed_rpm:
        return f"{table.speed_rpm:g} rpm are more than max_speed_rpm = {limits.tool.max_speed_rpm:g} of its tool"
    speed, borne = math.pi * table.tool_diameter_mm / 1e3 * table.speed_rpm, limits.cutting_speed_m_min
    if borne is None:
        return f"{table.speed_rpm:g} rpm are outside the speeds of the spindle"
    allowed = f"{_range(borne.low, borne.high)} m/min, {_bears(table, limits)}"
    return f"{table.speed_rpm:g} rpm are {_number(speed)} m/min at the edge, outside {allowed} ({borne.source})"


def _bears(table: ProgramTable, limits: ToolLimits) -> str:
    """Who bears that, in words."""
    tool = "the fastest tool" if limits.is_guessed else limits.tool.tool_material or "the tool"
    where = "in a slot" if limits.cut == "slot" else "at the side"
    return f"which {tool} of {table.tool_diameter_mm:g} mm bears {where}" + (
        f" of {table.material}" if table.material else ""
    )


def _range(low: float, high: float) -> str:
    return f"{_number(low)} to {_number(high)}"


def _number(value: float) -> str:
    return f"{value:.3g}" if value < 1000 else f"{value:.0f}"
