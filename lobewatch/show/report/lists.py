"""Lists of the report: tools and directions, tap tests."""

from __future__ import annotations

import math
from typing import Any

from lobewatch.decay import Light, SeriesStanding, Standing
from lobewatch.decay.light import LIGHTS as HARM
from lobewatch.history import Row
from lobewatch.logbook import Logbook
from lobewatch.machine.settings.machine_file import REFERENCE_CUT
from lobewatch.measuring.estimate import Estimate
from lobewatch.show.history.describe_cut import heard_text
from lobewatch.show.programs.verdicts import WORDS
from lobewatch.show.report.figure_data import Numbers
from lobewatch.show.report.first_screen import KINDS, LIGHTS
from lobewatch.show.trends.describe_trend import rate_text, short_text

HEADS = (
    "time",
    "tool",
    "direction",
    "f_n (Hz)",
    "zeta (%)",
    "K (N/um)",
    "bearing stiffness (N/um)",
    "temperature (degC)",
)


def series_lines(standing: Standing) -> list[dict[str, Any]]:
    """Tools and directions, a line each, the one that fell most first."""
    return [_series_line(one) for one in standing.series]


def _series_line(series: SeriesStanding) -> dict[str, Any]:
    worst = min((HARM[one.code] for one in series.remarks), key=list(Light).index, default=Light.GOOD)
    trend = series.trend
    return {
        "tool": series.tool,
        "direction": series.direction,
        "light": LIGHTS[worst],
        "kind": KINDS.get(worst, "doubt"),
        "points": 0 if trend is None else len(trend.points),
        "newest": f"{series.time:%Y-%m-%d}",
        "change": short_text(series),
        "rate": "-" if trend is None else rate_text(trend) or "from 8 points on",
    }


def tap_lines(logbook: Logbook) -> list[list[str]]:
    """Tap tests that count, the newest first: date, tool, direction, values, words of then."""
    return [_tap_line(row) for row in reversed(logbook.history.current)]


def cut_lines(logbook: Logbook) -> list[list[str]]:
    """Test cuts that count, the newest first: date, what was cut, speed, depth, what it sounded like, who heard it."""
    return [
        [
            f"{cut.at.astimezone():%Y-%m-%d %H:%M}",
            cut.program or REFERENCE_CUT,
            cut.tool,
            f"{cut.speed_rpm:.0f}",
            f"{1e3 * cut.depth:.4g}",
            heard_text(cut),
            cut.by,
        ]
        for cut in reversed(logbook.cuts)
    ]


def tap_numbers(logbook: Logbook) -> Numbers:
    """The same as numbers, oldest first."""
    return Numbers(HEADS, [_tap_numbers(row) for row in logbook.history.current])


def _tap_line(row: Row) -> list[str]:
    values = (row.frequency, row.damping_ratio, row.stiffness, row.bearing_stiffness)
    formats = (("{:.2f}", 1.0), ("{:.3f}", 0.01), ("{:.3f}", 1e6), ("{:.1f}", 1e6))
    told = [_number(value, form, scale) for value, (form, scale) in zip(values, formats, strict=True)]
    words = [f"{name} {WORDS[one.word].symbol}" for name, one in (row.rulings or {}).items()]
    asked = [f"question {one.code}" for one in row.questions]
    return [f"{row.time.astimezone():%Y-%m-%d %H:%M}", row.tool, row.direction, *told, "; ".join([*asked, *words])]


def _number(value: Estimate, form: str, scale: float) -> str:
    return form.format(value.value / scale) if value.is_known else "-"


def _tap_numbers(row: Row) -> list[Any]:
    values = (row.frequency.value, row.damping_ratio.value / 0.01, row.stiffness.value / 1e6)
    warmth = row.conditions.temperature_c
    bearing = row.bearing_stiffness.value / 1e6
    about = [row.time.isoformat(), row.tool, row.direction]
    return [*about, *values, bearing, math.nan if warmth is None else float(warmth)]
