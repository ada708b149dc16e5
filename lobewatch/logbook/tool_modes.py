"""Match the modes of the newest tap tests of several tools to modes of the model."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
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
"""Half-width that 95 % stay within, over the standard deviation."""


@dataclass(frozen=True, eq=False)
class TappedTool:
    """One tool with its newest tap test."""

    tool: str
    """Tool in the spindle."""
    tap_id: str
    """Identity of the tap test."""
    time: datetime
    """Time of the tap test."""
    spindle: Spindle
    """The model with this tool, as machine.toml has it."""
    mode_number: int
    """Number of the mode followed in the model; 1 is the lowest."""
    followed: Mode
    """The mode followed."""
    others: tuple[Mode, ...]
    """All other modes that are believed."""
    scatter: float
    """Standard deviation of a frequency from one mounting of the tool to the next, relative (-)."""
    tolerance: float
    """Standard error of each diameter of the drawing, relative (-)."""

    def frequency_std(self, mode: Mode) -> float:
        """Standard error of a frequency of this tap test (Hz), that of mounting the tool included."""
        own_error = float(mode.standard_error[0])
        return math.hypot(own_error if math.isfinite(own_error) else 0.0, self.scatter * mode.frequency)


def find_tapped_tools(
    logbook: Logbook, tools: Sequence[str], direction: str | None = None, mode: Sequence[int] = ()
) -> list[TappedTool]:
    """The newest test of each tool in one direction (None: that of the newest test of the first tool).

    mode: number of the mode followed of each in the model; empty: [mode] model_mode of all. ValueError for one tool
    alone or twice; DataError for one that was not tapped or has no model, and for a test in question.
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
        raise ValueError(f"--tool {tools[0]}: joint and bearings need the taps of two tools at least; name another one")
    for tool in tools:
        if tools.count(tool) > 1:
            raise ValueError(
                f"--tool {tool}: named {tools.count(tool)} times; name another tool, or give the same one at another "
                "stick-out a [[tool]] and a name of its own"
            )
    if mode and len(mode) != len(tools):
        raise ValueError(f"{len(mode)} --mode for {len(tools)} --tool; give one for each, or none")


def _find_newest_row(rows: Sequence[HistoryRow], tool: str, direction: str | None) -> HistoryRow:
    fits = [row for row in rows if row.tool == tool and direction in (None, row.direction)]
    if fits:
        return fits[-1]
    tapped = sorted({f"{row.tool}, {row.direction}" for row in rows})
    where = "" if direction is None else f" in direction {direction}"
    raise DataError(f"tool {tool!r} was never tapped{where}; tapped are: {'; '.join(tapped) or 'none'}; tap it first")


def _build_tapped_tool(logbook: Logbook, row: HistoryRow, number: int) -> TappedTool:
    measurement, machine = logbook.measurement(row.tap_id), logbook.machine
    if measurement.followed is None:
        raise DataError(f"{row.tap_id}: no mode is followed in the newest test of tool {row.tool!r}; tap it again")
    if not measurement.followed.has_stiffness:
        text = "no force was measured: K, by which modes are told apart, is not known"
        raise DataError(f"{row.tap_id}: {text}; tap tool {row.tool!r} with a hammer that measures its force")
    if asked := find_open_questions(measurement.remarks):
        codes = ", ".join(remark.code for remark in asked)
        raise DataError(f"{row.tap_id}: the newest test of tool {row.tool!r} is in question ({codes}); answer first")
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
        machine.drawing_tolerance,
    )


LOG_FREQUENCY_ERROR = 0.03
"""Of the logarithm of a frequency of a model that is not fitted to it yet."""
LOG_STIFFNESS_ERROR = 0.7
"""The same of a stiffness: modes that are close exchange their shapes."""
UNMATCHED_MODE_COST = 9.0
"""Sum of squares of these above which a mode is none of the model: 9 % of frequency, or a factor of 8 of stiffness."""
MAX_NEIGHBOR_MODES = 4
"""Modes of a tap test that are looked at beside the one followed, those nearest to it."""


class ModeMatch(NamedTuple):
    """The modes of a tap test in a model."""

    cost: float
    """Distance from those of the model, a sum of squares."""
    modes: tuple[tuple[int, Mode], ...]
    """Modes with their numbers in the model, in order."""


def assign_mode_numbers(tap: TappedTool, frequency: Sequence[float], stiffness: Sequence[float]) -> ModeMatch:
    """The cheapest way to number the modes of a tap test, in the order of the model, the one followed as it is known.

    frequency (Hz), stiffness (N/m): of the modes of the model where it was tapped. What fits none is left out, at a
    cost.
    """

    measured = sorted([tap.followed, *select_neighbor_modes(tap)], key=lambda mode: mode.frequency)
    best = [ModeMatch(0.0, ())] * (len(frequency) + 1)
    for mode in measured:
        skipped = math.inf if mode is tap.followed else UNMATCHED_MODE_COST
        row = [ModeMatch(best[0].cost + skipped, best[0].modes)]
        for number, model in enumerate(zip(frequency, stiffness, strict=True), 1):
            pair = _match_cost(mode, *model) if (mode is tap.followed) == (number == tap.mode_number) else math.inf
            taken = ModeMatch(best[number - 1].cost + pair, (*best[number - 1].modes, (number, mode)))
            left = ModeMatch(best[number].cost + skipped, best[number].modes)
            row.append(min(taken, left, row[-1], key=lambda candidate: candidate.cost))
        best = row
    return best[-1]


def select_neighbor_modes(tap: TappedTool) -> list[Mode]:
    """Those other modes of a tap test that are looked at."""

    def distance(mode: Mode) -> float:
        return abs(math.log(mode.frequency / tap.followed.frequency))

    return sorted(tap.others, key=distance)[:MAX_NEIGHBOR_MODES]


def _match_cost(mode: Mode, frequency: float, stiffness: float) -> float:
    """Of taking it for this one of the model."""
    apart = (
        math.log(mode.frequency / frequency) / LOG_FREQUENCY_ERROR,
        math.log(mode.stiffness / stiffness) / LOG_STIFFNESS_ERROR,
    )
    return apart[0] ** 2 + apart[1] ** 2
