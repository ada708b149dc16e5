"""Remarks on a program: tool limits, assumed defaults, and the decisive cause of uncertainty."""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from acquisition import Remark
from lobes.cut import CHECKED_DEPTH_SHARES
from lobewatch.machine import Machine, MissingToolData, ProgramTable, ToolLimits, find_tool_limits
from lobewatch.machine.settings.display_units import CUTTING_SPEED, FEED_PER_TOOTH, LENGTH, Quantity
from lobewatch.machine.settings.drive_power import CutRange
from lobewatch.measurement.coverage import describe_uncovered
from lobewatch.verdicts.monte_carlo import MonteCarloResult
from lobewatch.verdicts.program_case import FEED_ANGLE_STEP, ProgramCase
from lobewatch.verdicts.program_samples import N_PROGRAM_SAMPLES
from lobewatch.verdicts.uncertainty_causes import (
    COVERAGE,
    CROSS,
    QUESTION,
    SPEED_DROP,
    UNCERTAINTY_CAUSES,
    UNCHECKED,
    UNTAPPED,
    WORKPIECE,
)
from lobewatch.verdicts.zero_order_batch import ZeroOrderBatch

MISSING_TOOL_FACTS = {
    MissingToolData.TOOL_MATERIAL: "tool_material in the [[tool]]",
    MissingToolData.MATERIAL: "material in the program (Kt and Kr give no ISO 513 group)",
}
"""Missing tool data to ask for besides the cutting speed."""
TOOL_MAKER_KEYS = (MissingToolData.CUTTING_SPEED, MissingToolData.FEED_PER_TOOTH)
"""Keys of [[tool]] for data from the tool maker."""


def tool_limit_remarks(table: ProgramTable, machine: Machine) -> Iterator[Remark]:
    """Yield remarks on speed and feed per tooth outside the limits of the tool."""
    limits = find_tool_limits(machine, table)
    if not limits.low_rpm <= table.speed_rpm <= limits.high_rpm:
        reach = CutRange(machine, table, limits)
        cure = "Choose another tool" if limits.is_empty else f"Use {reach.low_rpm:g} to {reach.high_rpm:g} rpm"
        is_over = table.speed_rpm > limits.tool.max_speed_rpm
        own = "correct max_speed_rpm" if is_over else "set the cutting_speed_m_min of the tool maker"
        yield _tool_limit_remark(table, _speed_text(table, limits), f"{cure}, or {own}")
    feed, borne = table.feed_per_tooth_mm, limits.feed_per_tooth_mm
    if feed is not None and borne is not None and not borne.low <= feed <= borne.high:
        allowed = _range_text(borne.low, borne.high, FEED_PER_TOOTH)
        text = f"feed_per_tooth_mm = {feed:g} is outside {allowed} {_tool_text(table, limits)} ({borne.source})"
        yield _tool_limit_remark(table, text, f"Use {allowed}, or set the feed_per_tooth_mm of the tool maker")


def missing_tool_remarks(table: ProgramTable, limits: ToolLimits) -> Iterator[Remark]:
    """Ask for tool data that advice on a program needs."""
    if limits.is_guessed:
        whose = (
            "of the spindle" if limits.cutting_speed_m_min is None else "up to the limit of the fastest tool material"
        )
        asked = " and ".join(text for unknown, text in MISSING_TOOL_FACTS.items() if unknown in limits.missing)
        own = [key for key in TOOL_MAKER_KEYS if key is MissingToolData.CUTTING_SPEED or key in limits.missing]
        cure = ", or ".join(filter(None, [asked, f"{' and '.join(own)} in the [[tool]]"]))
        text = f"the cutting-speed limit is unknown, so speeds {whose} are recommended"
        yield Remark("tool-not-described", table.tool, text, f"Set {cure}")


def _tool_limit_remark(table: ProgramTable, text: str, cure: str) -> Remark:
    return Remark("outside-tool-limits", table.name, text, f"{cure} in [[tool]] {table.tool!r}")


def _speed_text(table: ProgramTable, limits: ToolLimits) -> str:
    if table.speed_rpm > limits.tool.max_speed_rpm:
        return f"{table.speed_rpm:g} rpm is above max_speed_rpm = {limits.tool.max_speed_rpm:g} of the tool"
    speed, borne = math.pi * table.tool_diameter_mm / 1e3 * table.speed_rpm, limits.cutting_speed_m_min
    if borne is None:
        return f"{table.speed_rpm:g} rpm is outside the speed range of the spindle"
    allowed = f"{_range_text(borne.low, borne.high, CUTTING_SPEED)} {_tool_text(table, limits)}"
    given = f"{_number_text(speed, CUTTING_SPEED)} {CUTTING_SPEED.unit}"
    return f"{table.speed_rpm:g} rpm gives {given}, outside {allowed} ({borne.source})"


def _tool_text(table: ProgramTable, limits: ToolLimits) -> str:
    """Return the source of the tool limits for a remark."""
    tool = "the fastest tool material" if limits.is_guessed else limits.tool.tool_material or "the tool"
    cut = "slotting" if limits.cut == "slot" else "side milling"
    material = f" of {table.material}" if table.material else ""
    return f"allowed for {tool}, {LENGTH.text(table.tool_diameter_mm)}, {cut}{material}"


def _range_text(low: float, high: float, quantity: Quantity) -> str:
    return f"{_number_text(low, quantity)} to {_number_text(high, quantity)} {quantity.unit}"


def _number_text(value: float, quantity: Quantity) -> str:
    return quantity.number(value, ".3g" if value < 1000 else ".0f")


NARROW_CUT_IMMERSION = 0.5
"""Immersion below which a corner engages the tool far more than a straight path (-)."""
ASSUMED_CORNER_FACTOR = 1.5
"""Assumed corner radius over tool radius."""
MAX_HELIX_IMMERSION = 0.2
"""Immersion below which a helix changes the limit (-)."""
CROSS_NOT_TAPPED_CODE = "cross-not-tapped"
"""Code of the remark that asks for a cross tap."""
MIN_CROSS_LIMIT_RATIO = 1.04
"""Highest over lowest limit for all open principal directions, from which a cross tap is requested."""


def assumption_remarks(case: ProgramCase, result: MonteCarloResult) -> Iterator[Remark]:
    """Warn about defaults assumed for missing program settings."""
    table = case.table
    is_plain = table.corner_radius_mm is None and not isinstance(table.radial_depth_mm, tuple)
    if table.immersion < NARROW_CUT_IMMERSION and is_plain:
        yield _corner_remark(case, result)
    if case.machine.helix_deg(table) is None and min(table.immersions) < MAX_HELIX_IMMERSION:
        risk = f"at ae/D {min(table.immersions):.2g} a helix may change the limit by a factor of 0.7 to 1.7"
        text = f"helix_deg is missing, 0 is assumed ({risk})"
        yield Remark("helix-not-written", table.name, text, "Set helix_deg, 0 for straight edges")
    if result.axes_ratio > MIN_CROSS_LIMIT_RATIO:
        used = "" if result.chatters_otherwise else ", worst case used"
        effect = f"limit changes by up to {100 * (result.axes_ratio - 1):.0f} %{used}"
        text = f"modes may have rotated principal directions ({effect})"
        yield Remark(CROSS_NOT_TAPPED_CODE, table.name, text, "Tap Circumstances.direction xy (hit in x, sensor in y)")


def _corner_remark(case: ProgramCase, result: MonteCarloResult) -> Remark:
    """Warn about a corner, by the zero-order limit at its immersion in the worst feed direction."""
    table = case.table
    radius = ASSUMED_CORNER_FACTOR * table.tool_diameter_mm / 2
    inside, radial = table.corner_immersion(radius), table.radial_mm[1]
    cut, median = replace(case.program.cut, immersion=inside), result.samples.rows[np.array([0])]
    fed = [replace(cut, feed_angle=i * FEED_ANGLE_STEP) for i in range(round(math.pi / FEED_ANGLE_STEP))]
    speed = np.array([table.speed_rpm])
    limit = min(float(ZeroOrderBatch.of(median.with_cut(way)).limits(speed)[0][0, 0]) for way in fed)
    ratio = limit / result.median.limit
    share = f", {100 * ratio:.0f} % of that on the straight path" if 0 < ratio < 1 else ""
    corner = f"a corner of {LENGTH.text(radius)} radius has ae {LENGTH.text(inside * table.tool_diameter_mm, '.2g')}"
    limited = f"limit in the corner about {LENGTH.text(1e3 * limit, '.2g')}{share}"
    text = f"evaluated at ae {LENGTH.text(radial)}, but {corner} ({limited})"
    straight = f"[{radial:g}, {radial:g}] if the path is straight"
    cure = f"Set corner_radius_mm, or radial_depth_mm = [smallest, largest] ({straight})"
    return Remark("one-engagement", table.name, text, cure)


N_CAUSE_SAMPLES = 60
"""Number of chattering samples that are analyzed for the cause."""


def find_decisive_cause(case: ProgramCase, result: MonteCarloResult) -> str:
    """Find the cause of uncertainty that decides a doubtful verdict: most chattering samples would be stable without.

    Where none of them chatters a direction that was not tapped is all that is left open.
    """
    if case.assembly.questions:
        return QUESTION.name
    if case.assembly.uncovered:
        return COVERAGE.name
    if case.assembly.unchecked:
        return UNCHECKED.name
    if case.table.thin and case.assembly.is_complete and not np.any(result.chatters):
        return WORKPIECE.name
    if UNTAPPED.name in result.samples.uncertainty.modes:
        return UNTAPPED.name
    if result.chatters_otherwise:
        return CROSS.name
    if not np.any(result.chatters):
        return SPEED_DROP.name if np.any(result.chatters_at_speed) else UNTAPPED.name
    return _find_most_frequent_cause(case, result)


def _find_most_frequent_cause(case: ProgramCase, result: MonteCarloResult) -> str:
    """Find the cause without which most of the chattering samples would be stable."""
    samples, uncertainty = result.samples, result.samples.uncertainty
    places, median = np.flatnonzero(result.chatters)[:N_CAUSE_SAMPLES], samples.rows[np.array([0])]
    shares = {}
    for cause in uncertainty.causes:
        rows = uncertainty.sample(median, N_PROGRAM_SAMPLES, without=cause)[places]
        grown = replace(samples, rows=rows).growth(case.depth * np.array(CHECKED_DEPTH_SHARES))
        shares[cause] = float(np.mean(np.max(grown, axis=1) < 0))
    return max(shares, key=lambda cause: shares[cause])


def uncertainty_advice(cause: str, case: ProgramCase, result: MonteCarloResult) -> Remark:
    """Name the decisive cause of uncertainty, and what would reduce it."""
    table, assembly, record = case.table, case.assembly, UNCERTAINTY_CAUSES[cause]
    missing, missing_remedy = assembly.missing_direction
    measure = "Measure Kt and Kr" if table.material else "Measure Kt and Kr, or set material"
    asked = ", ".join(dict.fromkeys(question.code for question in assembly.questions))
    tangential = result.median.limit / case.depth * case.program.cut.tangential
    values = {"kt": f"{tangential / 1e6:.0f}", "coefficients_remedy": measure, "questions": asked}
    values |= {"tool": repr(table.tool), "program": repr(table.name), "n_cuts": str(case.at_speed.n_cuts)}
    drop = result.samples.drop
    values["drop_percent"] = f"{100 * drop.low:.3g} to {100 * drop.high:.3g}"
    if assembly.uncovered:
        values["uncovered"], values["uncovered_remedy"] = describe_uncovered(assembly.uncovered)
    if assembly.unchecked:
        values["unchecked"], values["unchecked_remedy"] = describe_uncovered(assembly.unchecked)
    values |= {"missing": missing, "missing_remedy": missing_remedy}
    return decisive_remark(table.name, record.sentence.format_map(values), record.remedy.format_map(values))


def decisive_remark(program: str, text: str, cure: str) -> Remark:
    """Return the remark on the decisive cause of a doubtful verdict."""
    return Remark("doubt-decides", program, text, cure)
