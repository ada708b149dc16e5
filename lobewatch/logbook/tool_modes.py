"""Match the modes of the newest tap tests of several tools to modes of the model."""

import math
from collections.abc import Sequence
from datetime import datetime
from typing import NamedTuple

from acquisition import DataError
from dsm import Spindle
from lobewatch.history.history import HistoryRow
from lobewatch.logbook.logbook import Logbook
from lobewatch.measurement.recording_questions import find_open_questions
from lobewatch.verdicts.uncertainty import tap_scatter_of
from modal import Mode, select_credible_modes

HALF_WIDTH_95_PER_STD = 1.96
"""Half-width of a 95 % interval over the standard deviation (-)."""
LOG_FREQUENCY_ERROR = 0.03
"""Standard error of the logarithm of a model frequency before the fit (-)."""
LOG_STIFFNESS_ERROR = 0.7
"""Standard error of the logarithm of a model stiffness (-). Close modes exchange their shapes."""
UNMATCHED_MODE_COST = 9.0
"""Sum of squares above which a mode is not in the model (-): 9 % of frequency, or a factor of 8 of stiffness."""
MAX_NEIGHBOR_MODES = 4
"""Number of modes next to the followed mode that are matched at most."""


class TappedTool(NamedTuple):
    """Tool with its newest tap test."""

    tool: str
    """Tool in the spindle."""
    tap_id: str
    """Identity of the tap test."""
    time: datetime
    """Time of the tap test."""
    spindle: Spindle
    """Model of machine.toml with this tool."""
    mode_number: int
    """Number of the followed mode in the model, from 1."""
    followed: Mode
    """Followed mode."""
    others: tuple[Mode, ...]
    """All other credible modes."""
    scatter: float
    """Reclamping repeatability of a frequency: relative standard deviation (-)."""
    tolerance: float
    """Relative standard error of each diameter on the drawing (-)."""

    def frequency_std(self, mode: Mode) -> float:
        """Return the standard error of a frequency of this tap test, reclamping included (Hz)."""
        own_error = float(mode.standard_error[0])
        return math.hypot(own_error if math.isfinite(own_error) else 0.0, self.scatter * mode.frequency)


def find_tapped_tools(
    logbook: Logbook, tools: Sequence[str], direction: str | None = None, mode: Sequence[int] = ()
) -> list[TappedTool]:
    """Find the newest tap test of each tool in one direction.

    direction
        None for the direction of the newest tap test of the first tool.
    mode
        Number of the followed mode of each tool in the model. Empty for [mode] model_mode.

    Raises ValueError for fewer than two tools or a tool named twice. Raises DataError for a tool without a usable tap
    test or without a model.
    """
    _check_tools(tools, mode)
    for tool in tools:
        logbook.machine.model(tool)
    current = logbook.history.current
    direction = direction or _find_newest_row(current, tools[0], None).direction
    numbers = mode or [logbook.machine.mode.model_mode] * len(tools)
    rows = [_find_newest_row(current, tool, direction) for tool in tools]
    return [_build_tapped_tool(logbook, row, number) for row, number in zip(rows, numbers, strict=True)]


def _check_tools(tools: Sequence[str], mode: Sequence[int]) -> None:
    if len(tools) < 2:
        raise ValueError(f"calibrate_joints.tools {tools[0]} is only one tool. Name at least two tapped tools.")
    for tool in tools:
        if tools.count(tool) > 1:
            cure = "Name each tool once, or add a [[tool]] for the same tool at another stick-out."
            raise ValueError(f"calibrate_joints.tools {tool} is named {tools.count(tool)} times. {cure}")
    if mode and len(mode) != len(tools):
        numbers = f"{len(mode)} calibrate_joints.mode for {len(tools)} calibrate_joints.tools"
        raise ValueError(f"{numbers}. Give one mode number for each tool, or none.")


def _find_newest_row(rows: Sequence[HistoryRow], tool: str, direction: str | None) -> HistoryRow:
    matching = [row for row in rows if row.tool == tool and direction in (None, row.direction)]
    if matching:
        return matching[-1]
    tapped = sorted({f"{row.tool!r} in {row.direction}" for row in rows})
    where = "" if direction is None else f" in direction {direction}"
    raise DataError(
        f"tool {tool!r} was never tapped{where}. Tap this tool, or choose from: {', '.join(tapped) or 'none'}."
    )


def _build_tapped_tool(logbook: Logbook, row: HistoryRow, number: int) -> TappedTool:
    measurement, machine = logbook.measurement(row.tap_id), logbook.machine
    if measurement.followed is None:
        raise DataError(f"{row.tap_id}: no followed mode in the newest test of tool {row.tool!r}. Tap this tool again.")
    if not measurement.followed.has_stiffness:
        text = "stiffness K is unknown, because no force was measured"
        raise DataError(f"{row.tap_id}: {text}. Tap tool {row.tool!r} with a hammer that measures force.")
    if questions := find_open_questions(measurement.remarks):
        codes = ", ".join(remark.code for remark in questions)
        raise DataError(
            f"{row.tap_id}: open questions on the newest test of tool {row.tool!r}. Answer them first: {codes}."
        )
    low, high = machine.mode.band_hz or (0.0, math.inf)
    in_band = [mode for mode in measurement.modes if low <= mode.frequency <= high]
    scatter = tap_scatter_of(logbook.assembly(row.tool, row.tap_id), row.direction, machine.doubt)
    return TappedTool(
        row.tool,
        row.tap_id,
        row.time,
        machine.model(row.tool),
        number,
        measurement.followed,
        tuple(mode for mode in select_credible_modes(in_band).modes if mode is not measurement.followed),
        scatter.frequency / HALF_WIDTH_95_PER_STD,
        machine.spindle.tolerance if machine.spindle else 0.0,
    )


class ToolModeMatch(NamedTuple):
    """Modes of a tap test with their numbers in the model."""

    cost: float
    """Distance from the modes of the model, a sum of squares (-)."""
    modes: tuple[tuple[int, Mode], ...]
    """Numbers in the model and modes, in order."""


def assign_mode_numbers(tap: TappedTool, frequency: Sequence[float], stiffness: Sequence[float]) -> ToolModeMatch:
    """Assign model numbers to the modes of a tap test at the least cost, in the order of the model.

    The followed mode keeps its number. Another mode may stay without a number, at a cost. `frequency` (Hz) and
    `stiffness` (N/m) are those of the model at the tapped point.
    """
    measured = sorted([tap.followed, *select_neighbor_modes(tap)], key=lambda mode: mode.frequency)
    best = [ToolModeMatch(0.0, ())] * (len(frequency) + 1)
    for mode in measured:
        skipped = math.inf if mode is tap.followed else UNMATCHED_MODE_COST
        row = [ToolModeMatch(best[0].cost + skipped, best[0].modes)]
        for number, model in enumerate(zip(frequency, stiffness, strict=True), 1):
            pair = _match_cost(mode, *model) if (mode is tap.followed) == (number == tap.mode_number) else math.inf
            matched = ToolModeMatch(best[number - 1].cost + pair, (*best[number - 1].modes, (number, mode)))
            unmatched = ToolModeMatch(best[number].cost + skipped, best[number].modes)
            row.append(min(matched, unmatched, row[-1], key=lambda candidate: candidate.cost))
        best = row
    return best[-1]


def select_neighbor_modes(tap: TappedTool) -> list[Mode]:
    """Select the modes nearest to the followed mode."""

    def distance(mode: Mode) -> float:
        return abs(math.log(mode.frequency / tap.followed.frequency))

    return sorted(tap.others, key=distance)[:MAX_NEIGHBOR_MODES]


def _match_cost(mode: Mode, frequency: float, stiffness: float) -> float:
    frequency_distance = math.log(mode.frequency / frequency) / LOG_FREQUENCY_ERROR
    stiffness_distance = math.log(mode.stiffness / stiffness) / LOG_STIFFNESS_ERROR
    return frequency_distance**2 + stiffness_distance**2
