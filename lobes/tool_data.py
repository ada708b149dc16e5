"""Cutting speeds and feeds per tooth that are published for kinds of tool (the .csv beside this module).

A row of cutting_speeds.csv or feeds_per_tooth.csv is one source: for a group of VDI 3323 or of ISO 513, a tool
material, and slots or cuts at the side. The finest group that has rows counts; the range is taken over all of its rows,
and at least a quarter to both sides of its middle.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Literal, get_args

import numpy as np

from lobes.coefficients import CuttingCoefficients

ToolMaterial = Literal["HSS", "carbide", "coated carbide", "PCD", "CBN"]
"""Material of the edges of a tool."""
CutKind = Literal["slot", "side"]
"""Slot, or cut at the side of what is there."""
TOOL_MATERIALS: tuple[ToolMaterial, ...] = get_args(ToolMaterial)
"""All materials of edges."""
MIN_SLOT_IMMERSION = 0.4
"""Radial depth over diameter from which on a cut counts as a slot, as in the tables of Tungaloy."""
MIN_PUBLISHED_RANGE = 0.25
"""Least half-width of a range, of its middle: what one source is taken to be off by."""
ANY_MATERIAL_GROUP = "any"
"""Group of rows that hold for every material."""


@dataclass(frozen=True)
class PublishedRange:
    """Range that is published of a number."""

    low: float
    """Least value (m/s or m)."""
    high: float
    """Greatest value (m/s or m)."""
    sources: tuple[str, ...]
    """Sources that it lies over."""


def classify_cut(immersion: float) -> CutKind:
    """Kind of a cut by its radial depth over diameter (-): a slot from 0.4 on, as in the tables of Tungaloy.

    >>> classify_cut(1.0), classify_cut(0.1)
    ('slot', 'side')
    """
    return "slot" if immersion >= MIN_SLOT_IMMERSION else "side"


def published_cutting_speed(material: CuttingCoefficients, tool: ToolMaterial, cut: CutKind) -> PublishedRange | None:
    """Speeds of the edge (m/s) that are published for a group of materials and a tool; None where none are.

    Source: those that the range names, in the .csv beside this module.

    >>> aluminium = materials_by_name()[fold_material_name("AA 7075")]
    >>> speed = published_cutting_speed(aluminium, "carbide", "side")
    >>> f"{speed.low * 60:.0f} to {speed.high * 60:.0f} m/min"
    '148 to 1250 m/min'
    """
    rows = _finest_group_rows("cutting_speeds.csv", material, tool, cut)
    ranges = [(float(row["low_m_per_min"]) / 60, float(row["high_m_per_min"]) / 60) for row in rows]
    return _join_ranges(ranges, rows)


def published_feed_per_tooth(
    material: CuttingCoefficients, tool: ToolMaterial, cut: CutKind, diameter: float
) -> PublishedRange | None:
    """Feeds per tooth (m) that are published for tools of a diameter (m); None where none are.

    Between the diameters of a source on a line, below them in proportion to the diameter, above them as at the last.

    >>> aluminium = materials_by_name()[fold_material_name("AA 7075")]
    >>> stream_states = published_feed_per_tooth(aluminium, "carbide", "side", diameter=12e-3)
    >>> f"{stream_states.low * 1e3:.3f} to {stream_states.high * 1e3:.3f} mm"
    '0.075 to 0.150 mm'
    """
    rows = _finest_group_rows("feeds_per_tooth.csv", material, tool, cut)
    sources = dict.fromkeys(row["source"] for row in rows)
    return _join_ranges(
        [_feed_at_diameter([row for row in rows if row["source"] == name], diameter) for name in sources], rows
    )


def published_speed_of_any_tool(material: CuttingCoefficients, cut: CutKind) -> PublishedRange | None:
    """Speeds of the edge (m/s) up to the highest that is published of any tool material; None where none are.

    >>> aluminium = materials_by_name()[fold_material_name("AA 7075")]
    >>> round(published_speed_of_any_tool(aluminium, "side").high * 60)  # m/min
    1250
    """
    known = [speed for tool in TOOL_MATERIALS if (speed := published_cutting_speed(material, tool, cut))]
    if not known:
        return None
    fastest = max(known, key=lambda speed: speed.high)
    return PublishedRange(0.0, fastest.high, fastest.sources)


@cache
def published_rows(name: str) -> tuple[dict[str, str], ...]:
    """Rows of cutting_speeds.csv or feeds_per_tooth.csv."""
    return tuple(csv.DictReader((files("lobes") / name).read_text(encoding="utf-8").splitlines()))


def _finest_group_rows(
    name: str, material: CuttingCoefficients, tool: ToolMaterial, cut: CutKind
) -> list[dict[str, str]]:
    """Rows of the finest group that has any."""
    for group in (
        f"VDI {material.vdi_3323_group}",
        material.iso_group,
        *([ANY_MATERIAL_GROUP] if material.iso_group else ()),
    ):
        rows = [
            row
            for row in published_rows(name)
            if group in row["of"].split(";") and tool in row["tool_material"].split(";") and cut == row["cut"]
        ]
        if rows:
            return rows
    return []


def _feed_at_diameter(rows: Sequence[dict[str, str]], diameter: float) -> tuple[float, float]:
    """Feeds (m) of one source at a diameter (m)."""
    if rows[0]["unit"] == "D":
        return float(rows[0]["low"]) * diameter, float(rows[0]["high"]) * diameter
    points = sorted(point for row in rows for point in _diameter_points(row))
    at, low, high = np.array(points).T * 1e-3
    share = min(diameter / float(at[0]), 1.0)
    return float(np.interp(diameter, at, low)) * share, float(np.interp(diameter, at, high)) * share


def _diameter_points(row: dict[str, str]) -> Iterator[tuple[float, float, float]]:
    """Diameters of a row (mm), each with least and greatest feed (mm)."""
    for diameter in row["diameter_mm"].split(".."):
        yield float(diameter), float(row["low"]), float(row["high"])


def _join_ranges(ranges: Sequence[tuple[float, float]], rows: Sequence[dict[str, str]]) -> PublishedRange | None:
    """Over all of them, and at least as wide as one source is taken to be off."""
    if not ranges:
        return None
    low, high = min(low for low, _ in ranges), max(high for _, high in ranges)
    middle = (low + high) / 2
    sources = tuple(dict.fromkeys(row["source"] for row in rows))
    return PublishedRange(
        min(low, (1 - MIN_PUBLISHED_RANGE) * middle), max(high, (1 + MIN_PUBLISHED_RANGE) * middle), sources
    )
