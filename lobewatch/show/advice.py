"""Verdicts with advice, as `lobewatch check` and the report say them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from rich.table import Table

from acquisition import Remark
from lobewatch.analysis import Advice, Logbook, Verdict
from lobewatch.machine import SpeedRange
from lobewatch.show.output import table
from lobewatch.show.verdicts import limit_text, margin_text, program_cells, verdict_json, verdict_text

NEAR = 0.03
"""Relative distance in speed from the other state that is told of a stable program."""


@dataclass(frozen=True, eq=False)
class Advised:
    """A program with all that is said of it."""

    verdict: Verdict
    """The word and the limit."""
    advice: Advice
    """Where to go, and how much decay is left."""
    was_stable: bool | None
    """Whether it was stable at the first tap tests of the same tool and directions; None without earlier ones."""

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """Of both."""
        return (*self.verdict.remarks, *self.advice.remarks)

    @property
    def is_within_error(self) -> bool:
        """Whether a stable program lies above the lower edge of the band of its limit."""
        return bool(self.verdict.stable) and self.advice.limit_band[0] * 1e3 <= self.verdict.program.depth_mm


def advised(logbook: Logbook, verdict: Verdict) -> Advised:
    """All that is said of one program."""
    then = logbook.ruling_then(verdict)
    return Advised(verdict, logbook.advice(verdict), None if then is None else then.stable)


def advised_json(one: Advised) -> dict[str, Any]:
    """One program."""
    advice, speed = one.advice, one.verdict.program.speed_rpm
    low, high = advice.limit_band
    return verdict_json(one.verdict) | {
        "was_stable_at_first": one.was_stable,
        "limit_low_mm": low * 1e3,
        "limit_high_mm": high * 1e3,
        "nearest_speed_rpm": advice.nearest_speed,
        "speed_margin": advice.speed_margin(speed),
        "tolerable_decay": advice.decay,
        "remarks": [vars(remark) for remark in one.remarks],
    }


def advised_table(programs: Sequence[Advised]) -> Table:
    """Programs, a line each."""
    made = table("<program", "speed (rpm)", "depth (mm)", "limit (mm), 95 %", "margin", "decay left", "<verdict")
    for one in programs:
        behind = " any more" if one.was_stable and not one.verdict.stable else ""
        words = verdict_text(one.verdict, ", within the error" if one.is_within_error else behind)
        margin = margin_text(one.verdict)
        made.add_row(*program_cells(one.verdict), _limit(one), margin, decay_text(one.advice), words)
    return made


def _limit(one: Advised) -> str:
    low, high = (edge * 1e3 for edge in one.advice.limit_band)
    limit = limit_text(one.verdict)
    return f"{limit} ({low:.2f}..{high:.2f})" if one.verdict.measured and math.isfinite(low + high) else limit


def decay_text(advice: Advice) -> str:
    """How far the frequency may fall."""
    if math.isnan(advice.decay):
        return "-"
    if advice.decay == 0:
        return "none"
    return "> 20 %" if math.isinf(advice.decay) else f"{100 * advice.decay:.1f} %"


def advised_lines(one: Advised, speeds: SpeedRange) -> Iterator[str]:
    """What to do, a line for each thing that is called for."""
    found, advice = one.verdict, one.advice
    name, speed = found.program.name, found.program.speed_rpm
    if found.stable is False:
        word = "period-two chatter" if found.kind == "flip" else "chatter"
        yield (
            f"{name}: {word} near {found.chatter_frequency:.0f} Hz; at this speed cut no deeper than "
            f"{_settable(found.limit)} mm, or {_elsewhere(one, speeds)}"
        )
    elif advice.nearest_speed is not None and advice.speed_margin(speed) < NEAR:
        yield (
            f"{name}: only {100 * advice.speed_margin(speed):.1f} % of speed from chatter, which begins at "
            f"{advice.nearest_speed:.0f} rpm"
        )
    if found.stable is not None and found.is_beyond_drive:
        yield f"{name}: [drive] allows no more than {_settable(found.drive_limit)} mm at this speed"


def _elsewhere(one: Advised, speeds: SpeedRange) -> str:
    if one.advice.nearest_speed is None:
        drive = " that [drive] allows" if math.isfinite(one.verdict.drive_limit) else ""
        return (
            f"choose another tool: no stable speed{drive} at this depth in {speeds.low_rpm:g}..{speeds.high_rpm:g} rpm"
        )
    away = math.ceil if one.advice.nearest_speed > one.verdict.program.speed_rpm else math.floor
    return f"run this depth at {away(one.advice.nearest_speed)} rpm, the nearest stable speed"


def _settable(depth: float) -> str:
    """The deepest cut (mm) of two decimals that is not deeper (m)."""
    return f"{math.floor(depth * 1e5) / 100:.2f}"
