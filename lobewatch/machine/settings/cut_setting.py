"""What was cut, as machine.toml knows it: a program or the reference cut, at a speed and a depth."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, TypeVar

from lobes import Cut
from lobewatch.machine.settings.cut_power import PowerReading, power_reading
from lobewatch.machine.settings.cut_tables import CutTable, ProgramTable
from lobewatch.machine.settings.machine_file import REFERENCE_CUT, Machine

Table = TypeVar("Table", bound=CutTable)


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
        return self.cut.repeats * self.speed_rpm / 60

    def heard_cut_fields(self, speed_rpm: float) -> dict[str, Any]:
        """Fields of a `HeardCut` that follow from it and from the speed that was turned (rpm)."""
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


def cut_setting(
    machine: Machine, program: str, speed_rpm: float | None, depth_mm: float | None, power_kw: float | None = None
) -> CutSetting:
    """Setting of a program or "reference cut" at a speed and a depth; None: those of the program.

    power_kw: what the drive shows in it, more than in air. ValueError for a name, speed, depth or power that is none.
    """
    table = _table(machine, program)
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
    return replace(setting, power=power_reading(power_kw, table, known, cut, machine.drive, speed, setting.depth))


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
    return cut_setting(machine, program or cut, speed_rpm, depth_mm, power_kw)


def _table(machine: Machine, name: str) -> CutTable:
    tables: dict[str, CutTable] = {REFERENCE_CUT: machine.reference_cut} if machine.reference_cut else {}
    return find_named(tables | {table.name: table for table in machine.program}, name)


def find_named(tables: Mapping[str, Table], name: str) -> Table:
    """Table of this name, or the only one whose name begins so; ValueError where there is none, or are several."""
    fitting = [key for key in tables if key == name] or [key for key in tables if key.startswith(name)]
    if len(fitting) != 1:
        names = ", ".join(map(repr, fitting or tables)) or "none: add a [[program]] to machine.toml"
        why = "may be several: say more of its name" if fitting else "is not in machine.toml"
        raise ValueError(f"program {name!r} {why}; there are {names}")
    return tables[fitting[0]]
