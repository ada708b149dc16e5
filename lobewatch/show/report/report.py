"""Write the report of one machine, and the report of a fleet."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from datetime import datetime
from itertools import count
from pathlib import Path
from typing import Any

from dsm import format_with_error
from lobewatch.logbook import Logbook
from lobewatch.logbook.analysis import Analysis
from lobewatch.monitoring.status_rules import StatusLevel
from lobewatch.show.fleet.fleet_status import FLEET_COLUMNS
from lobewatch.show.history import condition_texts
from lobewatch.show.report.page import make_gauge, render_page, write_page
from lobewatch.show.report.report_data import collect_report_data
from lobewatch.show.report.section import NumberTable
from lobewatch.show.report.sections import SECTIONS, SectionMaker
from lobewatch.show.report.summary import make_summary
from lobewatch.show.terminal.output import JsonObject, json_fields
from lobewatch.show.terminal.status_labels import status_css_class
from lobewatch.verdicts.verdict import Stability


def write_report(
    logbook: Logbook,
    path: Path | None = None,
    tool: str = "",
    direction: str = "",
    sections: Sequence[SectionMaker] = SECTIONS,
) -> Path:
    """Write the report of one series, that of the newest test where none is named; DataError without a tap test.

    path None: report.html in the machine folder. sections: what makes those below its first screen, in their order.
    """
    newest = logbook.newest_tap()
    html = render_report(logbook, tool or newest.tool, direction or newest.direction, sections=sections)
    path = path or logbook.folder.path / "report.html"
    write_page(path, html)
    return path


def render_report(
    logbook: Logbook,
    tool: str,
    direction: str,
    now: datetime | None = None,
    sections: Sequence[SectionMaker] = SECTIONS,
) -> str:
    """Return the HTML of one series; raise ValueError where it has no tap test. now: None for the current time."""
    return render_page("report.html", **logbook.query(_report_content, tool, direction, now, sections))


REPORT_FIELDS = json_fields("""
    name=machine.machine.name tool=last.tool direction=last.direction last=last.time label=machine.spindle.label
    tap_id=newest.id software=analysis.history.software
""")


def _report_content(
    analysis: Analysis, tool: str, direction: str, now: datetime | None, sections: Sequence[SectionMaker]
) -> JsonObject:
    """Return all that the template shows, from one analysis."""
    data = collect_report_data(analysis, tool, direction, now)
    groups, tap = [make(data) for make in sections], data.newest
    return REPORT_FIELDS(data) | {
        "groups": groups,
        "has_plots": any(section.has_plot for group in groups for section in group),
        "numbering": count(1),
        "first": data.rows[0].time,
        "n_taps": len(data.rows),
        "as_of": data.outlook.status.time.astimezone(),
        "first_screen": make_summary(data),
        "conditions": [*filter(None, [tap.circumstances.operator]), *condition_texts(data.last.conditions)],
        "good": len(tap.accepted),
        "hits": len(tap.hits),
    }


SPARK_WIDTH, SPARK_HEIGHT = 140, 32
"""Size of a small trend line, in units of the figure."""


def write_fleet_report(rows: Sequence[Mapping[str, Any]], folder: Path, path: Path | None, now: datetime) -> Path:
    """Write the report of some machines, as `fleet_rows` tells them; path None: report.html in their folder."""
    path = path or folder / "report.html"
    write_page(path, render_fleet(rows, folder.resolve().name, now))
    return path


def render_fleet(rows: Sequence[Mapping[str, Any]], name: str, now: datetime) -> str:
    """Return the HTML of a fleet, a line for each machine, in the order of the rows."""
    lights = [row["light"] for row in rows]
    counts = ", ".join(f"{lights.count(light)} {light.value}" for light in StatusLevel if light in lights)
    numbers = NumberTable(FLEET_COLUMNS, [[_enum_value(row[column]) for column in FLEET_COLUMNS] for row in rows])
    machines = [_machine_content(row) for row in rows]
    return render_page("fleet.html", name=name, now=now, counts=counts, machines=machines, numbers=numbers)


def _enum_value(value: Any) -> Any:
    return value.value if isinstance(value, StatusLevel) else value


def _machine_content(row: Mapping[str, Any]) -> JsonObject:
    """Return a machine as the template takes it."""
    left, last = row["days_left"], row["last_tap"]
    due = (
        "never tapped" if left is None else f"in {math.floor(left)} d" if left >= 0 else f"{math.ceil(-left)} d overdue"
    )
    fall, std = row["fall"], row["fall_std"]
    has_changed = fall is not None and std != 0
    fallen = f"{format_with_error(-fall, std)} %" if has_changed else "nothing to compare with"
    return {
        "name": row["name"],
        "key": row["key"],
        "light": row["word"],
        "kind": status_css_class(row["light"], row["is_early"]),
        "reasons": row["reasons"] or [row["why"] or ("all is well" if row["light"] is StatusLevel.GOOD else "-")],
        "next_step": row["next_step"],
        "fallen": fallen,
        "gauge": make_gauge(fall, *row["limits"]) if has_changed else None,
        "series": row["series"],
        "spark": spark_points(row["points"]),
        "until": row["limit"],
        "programs": programs_text(row["programs"]),
        "due": f"{due}, last {last.partition('T')[0]}" if last else due,
    }


def programs_text(words: Mapping[str, str]) -> str:
    """Return the programs that may not be run, by verdict, and how many are stable."""
    named: dict[str, list[str]] = {}
    for program, word in words.items():
        named.setdefault(word, []).append(program)
    stable = named.pop(Stability.STABLE, [])
    texts = [f"{word}: {', '.join(programs)}" for word, programs in named.items()]
    return "; ".join([*texts, *([f"{len(stable)} stable"] if stable else [])]) or "-"


def spark_points(points: Sequence[tuple[float, float]]) -> str:
    """Return a trend (days, %) as points of a small polyline; empty below two points."""
    if len(points) < 2:
        return ""
    days, percents = zip(*points, strict=True)
    span, reach = days[-1] - days[0], max(max(percents) - min(percents), 1.0)
    places = (
        (SPARK_WIDTH * (day - days[0]) / (span or 1.0), SPARK_HEIGHT * (max(percents) - percent) / reach)
        for day, percent in points
    )
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in places)
