"""The newest tap tests of several tools, as far as a model can be fitted to them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

from acquisition import DataError
from dsm import Spindle
from lobewatch.history.history import Row
from lobewatch.logbook.logbook import Logbook
from lobewatch.measuring.questions import open_questions
from lobewatch.verdicts.doubt import scatter_in
from modal import Mode, believed

IN_95_PERCENT = 1.96
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
    number: int
    """Number of the mode followed in the model; 1 is the lowest."""
    followed: Mode
    """The mode followed."""
    others: tuple[Mode, ...]
    """All other modes that are believed."""
    scatter: float
    """Standard deviation of a frequency from one mounting of the tool to the next, relative (-)."""
    tolerance: float
    """Standard error of each diameter of the drawing, relative (-)."""

    def std(self, mode: Mode) -> float:
        """Standard error of a frequency of this tap test (Hz), that of mounting the tool included."""
        own_error = float(mode.standard_error[0])
        return math.hypot(own_error if math.isfinite(own_error) else 0.0, self.scatter * mode.frequency)


def tapped_tools(
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
    direction = direction or _newest(current, tools[0], None).direction
    numbers = mode or [logbook.machine.mode.model_mode] * len(tools)
    rows = [_newest(current, tool, direction) for tool in tools]
    return [_tapped(logbook, row, number) for row, number in zip(rows, numbers, strict=True)]


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


def _newest(rows: Sequence[Row], tool: str, direction: str | None) -> Row:
    fits = [row for row in rows if row.tool == tool and direction in (None, row.direction)]
    if fits:
        return fits[-1]
    tapped = sorted({f"{row.tool}, {row.direction}" for row in rows})
    where = "" if direction is None else f" in direction {direction}"
    raise DataError(f"tool {tool!r} was never tapped{where}; tapped are: {'; '.join(tapped) or 'none'}; tap it first")


def _tapped(logbook: Logbook, row: Row, number: int) -> TappedTool:
    measurement, machine = logbook.measurement(row.tap_id), logbook.machine
    if measurement.followed is None:
        raise DataError(f"{row.tap_id}: no mode is followed in the newest test of tool {row.tool!r}; tap it again")
    if not measurement.followed.has_stiffness:
        text = "no force was measured: K, by which modes are told apart, is not known"
        raise DataError(f"{row.tap_id}: {text}; tap tool {row.tool!r} with a hammer that measures its force")
    if asked := open_questions(measurement.remarks):
        codes = ", ".join(remark.code for remark in asked)
        raise DataError(f"{row.tap_id}: the newest test of tool {row.tool!r} is in question ({codes}); answer first")
    low, high = machine.mode.band_hz or (0.0, math.inf)
    in_band = [mode for mode in measurement.modes if low <= mode.frequency <= high]
    scatter = scatter_in(logbook.assembly(row.tool, row.tap_id), row.direction, machine.doubt)
    return TappedTool(
        row.tool,
        row.tap_id,
        row.time,
        machine.model(row.tool),
        number,
        measurement.followed,
        tuple(mode for mode in believed(in_band).modes if mode is not measurement.followed),
        scatter.frequency / IN_95_PERCENT,
        machine.drawing_tolerance,
    )
