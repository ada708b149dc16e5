"""Published cutting speeds and feeds per tooth for kinds of tool (the .csv files of this package).

A row of cutting_speeds.csv or feeds_per_tooth.csv is one source: for a group of VDI 3323 or of ISO 513, a tool
material, and slots or side cuts. The finest group with rows counts. The range covers all its rows,
and at least a quarter on both sides of its middle.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from lobes.coefficients import CuttingCoefficients
from lobes.materials import read_table

ToolMaterial = Literal["HSS", "carbide", "coated carbide", "PCD", "CBN"]
"""Material of the cutting edges."""
CutKind = Literal["slot", "side"]
"""Slot or side cut."""
TOOL_MATERIALS: tuple[ToolMaterial, ...] = get_args(ToolMaterial)
"""All materials of cutting edges."""
MIN_SLOT_IMMERSION = 0.4
"""Least immersion of a slot, as in the tables of Tungaloy."""
MIN_PUBLISHED_RANGE = 0.25
"""Least relative half-width of a range, the error of a single source."""


@dataclass(frozen=True)
class PublishedRange:
    """Published range of a number."""

    low: float
    """Smallest value (m/s or m)."""
    high: float
    """Largest value (m/s or m)."""
    sources: tuple[str, ...]
    """Sources of the range."""


def classify_cut(immersion: float) -> CutKind:
    """Classify a cut by its immersion: a slot from 0.4 on, as in the tables of Tungaloy.

    Parameters
    ----------
    immersion : float
        Radial depth of cut over cutter diameter (-).

    Returns
    -------
    {"slot", "side"}
        Kind of the cut.

    Examples
    --------
    >>> classify_cut(1.0), classify_cut(0.1)
    ('slot', 'side')
    """
    return "slot" if immersion >= MIN_SLOT_IMMERSION else "side"


def published_cutting_speed(material: CuttingCoefficients, tool: ToolMaterial, cut: CutKind) -> PublishedRange | None:
    """Return the published cutting speeds for a material and a tool.

    Parameters
    ----------
    material : CuttingCoefficients
        Material with its groups.
    tool : ToolMaterial
        Material of the cutting edges.
    cut : {"slot", "side"}
        Kind of the cut.

    Returns
    -------
    PublishedRange or None
        Cutting speeds (m/s) with sources; None if none are published.

    Examples
    --------
    >>> aluminium = materials_by_name()[fold_material_name("AA 7075")]
    >>> speed = published_cutting_speed(aluminium, "carbide", "side")
    >>> f"{speed.low * 60:.0f} to {speed.high * 60:.0f} m/min"
    '148 to 1250 m/min'
    """
    rows = _finest_rows("cutting_speeds.csv", material, tool, cut)
    ranges = [(float(row["low_m_per_min"]) / 60, float(row["high_m_per_min"]) / 60) for row in rows]
    return _join_ranges(ranges, rows)


def published_feed_per_tooth(
    material: CuttingCoefficients, tool: ToolMaterial, cut: CutKind, diameter: float
) -> PublishedRange | None:
    """Return the published feeds per tooth for a material and a tool.

    Linear between the diameters of a source, proportional to the diameter below them, constant above.

    Parameters
    ----------
    material : CuttingCoefficients
        Material with its groups.
    tool : ToolMaterial
        Material of the cutting edges.
    cut : {"slot", "side"}
        Kind of the cut.
    diameter : float
        Cutter diameter (m).

    Returns
    -------
    PublishedRange or None
        Feeds per tooth (m) with sources; None if none are published.

    Examples
    --------
    >>> aluminium = materials_by_name()[fold_material_name("AA 7075")]
    >>> feed = published_feed_per_tooth(aluminium, "carbide", "side", diameter=12e-3)
    >>> f"{feed.low * 1e3:.3f} to {feed.high * 1e3:.3f} mm"
    '0.075 to 0.150 mm'
    """
    rows = _finest_rows("feeds_per_tooth.csv", material, tool, cut)
    sources = dict.fromkeys(row["source"] for row in rows)
    by_source = [[row for row in rows if row["source"] == name] for name in sources]
    return _join_ranges([_feed_at_diameter(own, diameter) for own in by_source], rows)


def published_speed_of_any_tool(material: CuttingCoefficients, cut: CutKind) -> PublishedRange | None:
    """Return the range up to the highest published cutting speed of any tool material.

    Parameters
    ----------
    material : CuttingCoefficients
        Material with its groups.
    cut : {"slot", "side"}
        Kind of the cut.

    Returns
    -------
    PublishedRange or None
        Cutting speeds (m/s) from 0; None if none are published.

    Examples
    --------
    >>> aluminium = materials_by_name()[fold_material_name("AA 7075")]
    >>> round(published_speed_of_any_tool(aluminium, "side").high * 60)  # m/min
    1250
    """
    known = [speed for tool in TOOL_MATERIALS if (speed := published_cutting_speed(material, tool, cut))]
    fastest = max(known, key=lambda speed: speed.high, default=None)
    return fastest and PublishedRange(0.0, fastest.high, fastest.sources)


def _finest_rows(name: str, material: CuttingCoefficients, tool: ToolMaterial, cut: CutKind) -> list[dict[str, str]]:
    """Return the rows of the finest group that has any."""
    table = [row for row in read_table(name) if tool in row["tool_material"].split(";") and cut == row["cut"]]
    any_group = ["any"] if material.iso_group else []
    for group in (f"VDI {material.vdi_3323_group}", material.iso_group, *any_group):
        rows = [row for row in table if group in row["of"].split(";")]
        if rows:
            return rows
    return []


def _feed_at_diameter(rows: Sequence[dict[str, str]], diameter: float) -> tuple[float, float]:
    """Return the feeds (m) of one source at a diameter (m)."""
    if rows[0]["unit"] == "D":
        return float(rows[0]["low"]) * diameter, float(rows[0]["high"]) * diameter
    diameters = [(float(diameter), row) for row in rows for diameter in row["diameter_mm"].split("..")]
    points = sorted((diameter, float(row["low"]), float(row["high"])) for diameter, row in diameters)
    at, low, high = np.array(points).T * 1e-3
    share = min(diameter / float(at[0]), 1.0)
    return float(np.interp(diameter, at, low)) * share, float(np.interp(diameter, at, high)) * share


def _join_ranges(ranges: Sequence[tuple[float, float]], rows: Sequence[dict[str, str]]) -> PublishedRange | None:
    """Return the range over all sources, at least as wide as the error of a single one."""
    if not ranges:
        return None
    low, high = min(low for low, _ in ranges), max(high for _, high in ranges)
    middle = (low + high) / 2
    sources = tuple(dict.fromkeys(row["source"] for row in rows))
    low, high = min(low, (1 - MIN_PUBLISHED_RANGE) * middle), max(high, (1 + MIN_PUBLISHED_RANGE) * middle)
    return PublishedRange(low, high, sources)
