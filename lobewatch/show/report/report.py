"""Write the report of one machine with its status, and the report of a fleet."""

import math
from collections.abc import Mapping, Sequence
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

from lobewatch.logbook import Analysis, Logbook
from lobewatch.monitoring.status_rules import StatusLevel
from lobewatch.show.fleet.fleet_status import FLEET_COLUMNS, due_text, half_width_of, has_comparison
from lobewatch.show.report.page import make_gauge, render_page, write_page
from lobewatch.show.report.report_data import ReportData, collect_report_data
from lobewatch.show.report.section import NumberTable
from lobewatch.show.report.sections import SECTIONS, SectionMakers, make_programs, make_series
from lobewatch.show.terminal.output import JsonObject
from lobewatch.show.terminal.status_labels import status_css_class, status_label, status_name
from lobewatch.verdicts import Stability


def write_report(
    logbook: Logbook, path: Path | None = None, tool: str = "", direction: str = "", sections: SectionMakers = SECTIONS
) -> Path:
    """Write the report of one series, by default that of the most severe reason; DataError without a tap test.

    path None: report.html in the machine folder. sections: makers of the sections below the first screen, in order.
    """
    newest, series = logbook.newest_tap(), logbook.status().series
    fits = [one for one in series if tool in ("", one.tool) and direction in ("", one.direction)]
    shown = fits[0] if fits else newest
    html = render_report(logbook, tool or shown.tool, direction or shown.direction, sections=sections)
    path = path or logbook.folder.path / "report.html"
    write_page(path, html)
    return path


def render_report(
    logbook: Logbook, tool: str, direction: str, now: datetime | None = None, sections: SectionMakers = SECTIONS
) -> str:
    """Return the HTML of one series; raise ValueError if it has no tap test. now: None for the current time."""
    return render_page("report.html", **logbook.query(_report_content, tool, direction, now, sections))


def _report_content(
    analysis: Analysis, tool: str, direction: str, now: datetime | None, sections: SectionMakers
) -> JsonObject:
    """Return all that the template shows, from one analysis."""
    data = collect_report_data(analysis, tool, direction, now)
    return {
        "data": data,
        "summary": make_summary(data),
        "first_sections": [*make_series(data), *make_programs(data)],
        "sections": [section for make in sections for section in make(data)],
    }


def make_summary(data: ReportData) -> dict[str, Any]:
    """Return the status, next step and reasons for the template."""
    status, limits, series = data.outlook.status, data.machine.limits, data.series
    level, has_changed = (status.status, status.is_early), series.drop.is_known and not series.is_baseline
    levels = limits.frequency_warn_percent, limits.frequency_alarm_percent
    return {
        "label": status_label(*level),
        "kind": status_css_class(*level),
        "gauge": make_gauge(series.drop.value, *levels, series.drop.half_width) if has_changed else None,
        "next_step": status.next_step,
        "reasons": data.reasons[0],
        "has_notes": bool(data.reasons[1]),
        "next_tap": _next_tap_text(data),
    }


def _next_tap_text(data: ReportData) -> str:
    left, last = data.outlook.status.days_left, data.outlook.status.last_tap
    if left is None or last is None:
        return "now (never tapped)"
    due = f"{last + timedelta(days=math.floor(data.machine.machine.interval_days)):%Y-%m-%d}"
    return f"now (overdue since {due})" if left < 0 else f"by {due}"


SPARK_WIDTH, SPARK_HEIGHT = 140, 32
"""Size of a sparkline (units of the figure)."""


def write_fleet_report(rows: Sequence[Mapping[str, Any]], folder: Path, path: Path | None, now: datetime) -> Path:
    """Write the report of the machines of `fleet_rows`; path None: report.html in their folder."""
    path = path or folder / "report.html"
    write_page(path, render_fleet(rows, folder.resolve().name, now))
    return path


def render_fleet(rows: Sequence[Mapping[str, Any]], name: str, now: datetime) -> str:
    """Return the HTML of a fleet with a row for each machine, in the order of the rows."""
    levels = [row["light"] for row in rows]
    counts = ", ".join(f"{levels.count(level)} {status_name(level)}" for level in StatusLevel if level in levels)
    numbers = NumberTable(FLEET_COLUMNS, [[row[column] for column in FLEET_COLUMNS] for row in rows])
    machines = [_machine_content(row) for row in rows]
    return render_page("fleet.html", name=name, now=now, counts=counts, machines=machines, numbers=numbers)


def _machine_content(row: Mapping[str, Any]) -> JsonObject:
    """Return a machine for the template."""
    left, last, limits = row["days_left"], row["last_tap"], row["limits"]
    due = "never tapped" if left is None else due_text(left)
    is_good, has_gauge = row["light"] is StatusLevel.GOOD, limits and has_comparison(row)
    return {
        **row,
        "kind": status_css_class(row["light"], row["is_early"]),
        "reasons": row["reasons"] or ["no finding" if is_good else "-"],
        "change": row["change"] or "first test",
        "gauge": make_gauge(row["fall"], limits[0], limits[1], half_width_of(row)) if has_gauge else None,
        "spark": spark_points(row["points"]),
        "programs": program_lines(row["programs"]),
        "due": f"tap test {due}, last {last.partition('T')[0]}" if last else due,
    }


def program_lines(words: Mapping[str, str]) -> list[str]:
    """Return the programs that must not be run, by verdict, and the number of stable ones."""
    named: dict[str, list[str]] = {}
    for program, word in words.items():
        named.setdefault(word, []).append(program)
    stable = named.pop(Stability.STABLE, [])
    texts = [f"{word}: {', '.join(programs)}" for word, programs in named.items()]
    return [*texts, *([f"{len(stable)} stable"] if stable else [])] or ["-"]


def spark_points(points: Sequence[tuple[float, float]]) -> str:
    """Return a trend (days, %) as points of a polyline; empty below two points."""
    if len(points) < 2:
        return ""
    (first, *_, last), percents = zip(*points, strict=True)
    top, span, reach = max(percents), last - first or 1.0, max(max(percents) - min(percents), 1.0)
    return " ".join(
        f"{SPARK_WIDTH * (day - first) / span:.1f},{SPARK_HEIGHT * (top - drop) / reach:.1f}" for day, drop in points
    )
