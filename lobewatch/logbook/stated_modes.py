"""Stability lobes of stated modes: frequency, damping ratio and stiffness, without a machine folder."""

import json
import re
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any, NamedTuple

from acquisition import Remark
from lobewatch.logbook.chart_data import LobeComparison, no_pocket_remark
from lobewatch.machine import Machine
from lobewatch.machine.settings import requested_cut
from lobewatch.machine.settings.machine_file import REFERENCE_CUT, parse_machine_file
from lobewatch.machine.settings.setup_tables import SpeedTable
from lobewatch.machine.settings.toml import find_plausible_ranges
from lobewatch.machine.setup_questions.draft import parse_numbers
from lobewatch.tool import lobe_chart
from lobewatch.tool.assembly import Assembly, speed_grid
from lobewatch.verdicts import find_stable_pockets
from lobewatch.verdicts.verdict import evaluate_program
from modal import Mode

LBF_PER_INCH = 4.4482216152605 / 0.0254
"""Pound-force per inch in N/m."""
STIFFNESS_UNITS = {
    "N/m": 1.0,
    "kN/m": 1e3,
    "N/mm": 1e3,
    "MN/m": 1e6,
    "kN/mm": 1e6,
    "N/um": 1e6,
    "N/µm": 1e6,
    "lbf/in": LBF_PER_INCH,
}
"""Units of a stiffness in N/m."""
FREQUENCY_UNITS = {"Hz": 1.0, "kHz": 1e3}
"""Units of a frequency in Hz."""
NUMBER = r"[+-]?\d+(?:\.\d+)?(?:e[+-]?\d+)?"
MODE_PATTERN = re.compile(
    rf"\s*({NUMBER})\s*([a-z]+)[\s,]+(?:zeta\s*=?\s*)?({NUMBER})\s*(%?)[\s,]+({NUMBER})\s*([a-zµ/]*)\s*", re.IGNORECASE
)
MODE_RANGES = {"frequency": (1.0, 20e3, "Hz"), "damping ratio": (1e-4, 0.5, ""), "stiffness": (1e4, 1e10, "N/m")}
"""Plausible range of each number of a mode, with its unit; chosen."""
MAX_BARE_DAMPING_RATIO = 0.1
"""Largest damping ratio that needs no %; chosen, as a larger number is rather a percentage."""
EXAMPLE = "Write frequency, damping ratio and stiffness with their units, such as '600 Hz 3% 10 N/um'."
DEFAULT_DIAMETER_MM = 10.0
"""Tool diameter where none is stated; chosen. It limits depth and cutting speed."""


def parse_mode(text: str) -> Mode:
    """Parse a mode such as "600 Hz 3% 10 N/um".

    Parameters
    ----------
    text
        Natural frequency, damping ratio (in percent or as a ratio up to 0.5) and stiffness, with units.

    Returns
    -------
    Mode
        Mode in SI units.

    Raises
    ------
    ValueError
        For another form, a missing or unknown unit, and an implausible number.

    Examples
    --------
    >>> mode = parse_mode("600 Hz 3% 10 N/um")
    >>> mode.frequency, mode.damping_ratio, mode.stiffness
    (600.0, 0.03, 10000000.0)
    """
    match = MODE_PATTERN.fullmatch(text)
    if match is None:
        raise ValueError(f"{text!r} is not a mode. {EXAMPLE}")
    frequency, hertz, damping, percent, stiffness, unit = match.groups()
    if not percent and float(damping) > MAX_BARE_DAMPING_RATIO:
        raise ValueError(f"damping {damping} of {text!r} has no unit. Write {damping} % or {100 * float(damping):g} %.")
    values = (
        float(frequency) * _find_unit(text, hertz, FREQUENCY_UNITS),
        float(damping) / (100 if percent else 1),
        float(stiffness) * _find_unit(text, unit, STIFFNESS_UNITS),
    )
    for (name, (low, high, si)), value in zip(MODE_RANGES.items(), values, strict=True):
        if not low <= value <= high:
            raise ValueError(
                f"{name} {value:g} {si}".rstrip() + f" of {text!r} is not within {low:g} to {high:g}. {EXAMPLE}"
            )
    return Mode(*values, method="stated")


def _find_unit(text: str, unit: str, units: Mapping[str, float]) -> float:
    """Return the factor of a unit. Case counts for M (mega) only."""
    matches = [name for name in units if name == unit or (name[0] != "M" and name.lower() == unit.lower())]
    if not matches:
        problem = f"unit {unit!r} of {text!r} is unknown" if unit else f"{text!r} has no unit of the stiffness"
        raise ValueError(f"{problem}. Use {', '.join(units)}.")
    return units[matches[0]]


class StatedCut(NamedTuple):
    """Cut to evaluate on stated modes."""

    teeth: int
    """Number of flutes."""
    material: str
    """Material of `lobewatch materials`."""
    diameter_mm: float | None = None
    """Tool diameter (mm); None for `DEFAULT_DIAMETER_MM`."""
    radial_depth_mm: float | None = None
    """Radial depth of cut ae (mm); None for a slot."""
    direction: str = "down"
    """Milling direction, "up" or "down"."""
    low_rpm: float = 1000.0
    """Lowest spindle speed (rpm)."""
    high_rpm: float = 24000.0
    """Highest spindle speed (rpm)."""

    def with_speeds(self, text: str) -> "StatedCut":
        """Return the cut with the lowest and highest speed of a text; ValueError for other texts."""
        ranges = find_plausible_ranges(SpeedTable)
        limits = [(ranges[key].low, ranges[key].high) for key in ("low_rpm", "high_rpm")]
        low, high = parse_numbers(text, ("lowest speed", "highest speed"), limits=limits)
        return self._replace(low_rpm=low, high_rpm=high)


def build_stated_machine(cut: StatedCut) -> Machine:
    """Build a machine with default uncertainties, whose [reference_cut] is a stated cut. ValueError for bad values."""
    if cut.teeth < 1:
        raise ValueError(f"StatedCut.teeth {cut.teeth} is not above 0. Give the number of flutes.")
    if cut.radial_depth_mm is not None and cut.diameter_mm is None:
        raise ValueError(f"StatedCut.radial_depth_mm {cut.radial_depth_mm:g} needs StatedCut.diameter_mm. Give both.")
    diameter = cut.diameter_mm or DEFAULT_DIAMETER_MM
    tables: dict[str, dict[str, Any]] = {
        "machine": {"name": "stated modes"},
        "speed": {"low_rpm": cut.low_rpm, "high_rpm": cut.high_rpm},
        "reference_cut": {
            "teeth": cut.teeth,
            "tool_diameter_mm": diameter,
            "radial_depth_mm": cut.radial_depth_mm or diameter,
            "direction": cut.direction,
            "material": cut.material,
        },
    }
    lines = [
        line
        for name, values in tables.items()
        for line in (f"[{name}]", *(f"{key} = {json.dumps(value)}" for key, value in values.items()))
    ]
    return parse_machine_file("\n".join(lines), "stated cut")


def compare_stated_modes(
    cut: StatedCut,
    x: Sequence[Mode],
    y: Sequence[Mode],
    speed_rpm: float | None = None,
    depth_mm: float | None = None,
    method: lobe_chart.LobeMethod = lobe_chart.LobeMethod.ZERO_ORDER,
) -> LobeComparison:
    """Compute lobes and stable pockets of stated modes, and the verdict on one setting.

    Parameters
    ----------
    cut
        Stated cut.
    x, y
        Modes at the tool tip; y is empty for a tip that is equal in both directions.
    speed_rpm, depth_mm
        Setting to evaluate: spindle speed (rpm) and axial depth ap (mm); None for none.
    method
        Method of the chart.

    Returns
    -------
    LobeComparison
        Chart, pockets and verdict, with remarks on the assumptions.

    Raises
    ------
    ValueError
        For a speed without a depth and vice versa, and for values out of range.
    """
    if (speed_rpm is None) != (depth_mm is None):
        raise ValueError(
            "ProgramTable.speed_rpm or ProgramTable.depth_mm is missing. Give both for a verdict, or none."
        )
    machine = build_stated_machine(cut)
    tip = _build_tip(machine, x, y, cut)
    table, cuts = machine.cut_tables[REFERENCE_CUT], machine.cuts(tip.tool)[REFERENCE_CUT]
    lobes = lobe_chart.compute_lobe_chart(method, tip.x, tip.y, cuts, speed_grid(machine))
    now = lobe_chart.LobeChart(REFERENCE_CUT, table, tip, lobe_chart.DynamicsSource.MODES, tip.x, tip.y, cuts, lobes)
    pockets = find_stable_pockets(table, tip, machine)
    verdicts = []
    if speed_rpm is not None:
        fields = {name: getattr(table, name) for name in table.__struct_fields__ if getattr(table, name) is not None}
        setting = {"speed_rpm": speed_rpm, "depth_mm": depth_mm, "tool": tip.tool}
        program = requested_cut.build_requested_program(machine, fields | setting)
        verdicts = [evaluate_program(program, tip, machine)]
    remarks = [*tip.remarks, *lobes.remarks, *([] if pockets else [no_pocket_remark(now, machine)])]
    return LobeComparison(now, None, pockets, (), verdicts, remarks)


def _build_tip(machine: Machine, x: Sequence[Mode], y: Sequence[Mode], cut: StatedCut) -> Assembly:
    """Return the tool with the stated modes and remarks on what is assumed."""
    text = "modes are stated, not measured, with the default uncertainties" + ("" if y else ", and equal in x and y")
    remarks = [Remark("modes-stated", "", text, "Tap the tool, or state the modes in y if they differ")]
    if cut.diameter_mm is None:
        text = f"tool diameter {DEFAULT_DIAMETER_MM:g} mm is assumed, which limits depth and cutting speed"
        remarks.append(Remark("diameter-assumed", "", text, "Give StatedCut.diameter_mm"))
    time, directions = datetime.now(UTC), ("x", "y")
    return Assembly(machine.tap.tool, time, "stated modes", x, y or x, directions, None, {}, False, tuple(remarks))
