"""The same spindle with another tool."""

from __future__ import annotations

from dataclasses import replace

from dsm.spindle.cut_spindle import cut_spindle, moved
from dsm.spindle.spindle import Spindle


def change_tool(spindle: Spindle, position: float, tool: Spindle) -> Spindle:
    """The spindle beyond `position` from its tool tip (m) with `tool` in front of it.

    tool: a free shaft, its first segment the new tool tip, its last one fast to the spindle. A bearing, a mass or a
    joint where the spindle is cut stays with it; all that is nearer to the old tip falls away. Segments of the tool
    without a material of their own keep that of the tool. Raises ValueError for a cut off the shaft, a tool with
    bearings, and one of another beam theory.

    >>> long_tool = Spindle([Segment(0.1, 0.02), Segment(0.3, 0.05)], [Bearing(0.15, 2e8), Bearing(0.38, 2e8)])
    >>> short_tool = change_tool(long_tool, 0.1, Spindle([Segment(0.06, 0.02)], []))
    >>> round(short_tool.length, 2), [round(bearing.position, 2) for bearing in short_tool.bearings]  # m
    (0.36, [0.11, 0.34])
    """
    check_tool(tool, spindle.theory)
    rest, joint = cut_spindle(spindle, position)
    between = [] if joint is None else [replace(joint, position=tool.length)]
    segments = list(tool.segments)
    if tool.material != spindle.material:
        segments = [replace(segment, material=segment.material or tool.material) for segment in segments]
    return replace(
        rest,
        segments=[*segments, *rest.segments],
        bearings=moved(rest.bearings, tool.length),
        masses=[*tool.masses, *moved(rest.masses, tool.length)],
        joints=[*tool.joints, *between, *moved(rest.joints, tool.length)],
    )


def check_tool(tool: Spindle, theory: str) -> None:
    """Raise ValueError for what cannot be put into a spindle of a beam theory."""
    if tool.bearings:
        raise ValueError(f"the tool has {len(tool.bearings)} bearing(s); give it without, as a free shaft")
    if tool.theory != theory:
        raise ValueError(f"theory={tool.theory!r} of the tool is not that of the spindle, {theory!r}")
