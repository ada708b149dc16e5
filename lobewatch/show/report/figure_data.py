"""The numbers of a figure, as they go with it in the page."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from acquisition import Frf
from lobewatch.decay.trend import date
from lobewatch.measuring.estimate import Estimate
from lobewatch.show.figures.trend_figures import TrendCurve

Floats = NDArray[np.float64]

MOST = 1500
"""Lines of a response that are given, at most."""


class Numbers(NamedTuple):
    """A table."""

    heads: Sequence[str]
    """Headings of the columns, with units."""
    lines: Sequence[Sequence[Any]]
    """Texts and numbers of each row."""

    @property
    def text(self) -> str:
        """The table as JSON that can stand within a page; what is not finite is null."""
        lines = [[_cell(value) for value in line] for line in self.lines]
        exact = json.dumps({"heads": list(self.heads), "lines": lines}, ensure_ascii=False, separators=(",", ":"))
        return exact.replace("<", "\\u003c").replace("&", "\\u0026")


def value_numbers(
    unit: str,
    scale: float,
    estimates: Iterable[tuple[datetime, Estimate]],
    aside: Iterable[tuple[datetime, float]],
    course: TrendCurve | None,
) -> Numbers:
    """A value over time: tests, those that do not count, fitted line, and the band of 80 % ahead.

    scale: of the unit; the values of `estimates` alone are in SI.
    """
    lines: list[list[Any]] = [
        ["test", _day(time), estimate.value / scale, estimate.std / scale, "", ""] for time, estimate in estimates
    ]
    lines += [["does not count", _day(time), value, "", "", ""] for time, value in aside]
    if course is not None:
        past = course.days.size - course.days_ahead.size
        lines += [
            ["fitted", _day(date(day)), value, "", "", ""]
            for day, value in zip(course.days[:past].tolist(), course.line[:past].tolist(), strict=True)
        ]
        ahead = np.column_stack([course.days_ahead, course.line[past:], course.low, course.high])[::10]
        lines += [["forecast", _day(date(day)), value, "", low, high] for day, value, low, high in ahead.tolist()]
    return Numbers(["what", "date", unit, f"standard error ({unit})", f"10 % ({unit})", f"90 % ({unit})"], lines)


def lobe_numbers(speed_rpm: Floats, depths: Mapping[str, Floats]) -> Numbers:
    """Lines over speed (n,), depths in m by what each is called."""
    heads = ["speed (rpm)", *(f"{name}: limiting depth (mm)" for name in depths)]
    step = math.ceil(speed_rpm.size / MOST)
    return Numbers(heads, np.column_stack([speed_rpm, *(1e3 * depth for depth in depths.values())])[::step].tolist())


def response_numbers(frf: Frf) -> Numbers:
    """A frequency response in its band; no more lines than one can see."""
    step = math.ceil(frf.frequency.size / MOST)
    coherence = np.full(frf.frequency.size, np.nan) if frf.coherence is None else frf.coherence
    columns = (frf.frequency, frf.receptance.real * 1e9, frf.receptance.imag * 1e9, coherence)
    lines = np.column_stack([column[::step] for column in columns])
    return Numbers(["frequency (Hz)", "Re (nm/N)", "Im (nm/N)", "coherence"], lines.tolist())


def _day(time: datetime) -> str:
    return f"{time:%Y-%m-%d}"


def _cell(value: Any) -> Any:
    if not isinstance(value, float):
        return value
    return float(f"{value:.5g}") if math.isfinite(value) else None
