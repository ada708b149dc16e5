"""Write the report of one machine with its summary, and the report of a fleet."""

import math
from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime, timedelta
from itertools import count
from pathlib import Path
from typing import Any

from acquisition import Remark, merge_remarks
from dsm import format_with_error
from lobewatch.logbook import Analysis, Logbook
from lobewatch.machine import Machine
from lobewatch.monitoring import MachineStatus, SeriesStatus
from lobewatch.monitoring.status_rules import STATUS_BY_CODE, StatusLevel
from lobewatch.monitoring.threshold_dates import NO_FORECAST, ProgramForecast
from lobewatch.show.figures.drawing import render_svg
from lobewatch.show.figures.lobe_figures import SMALL_FIGURE_SIZE, plot_lobes
from lobewatch.show.figures.trend_figures import plot_frf, plot_trend
from lobewatch.show.fleet.fleet_status import FLEET_COLUMNS, due_text
from lobewatch.show.history import condition_texts
from lobewatch.show.programs.advice import ProgramAdvice, format_rpm
from lobewatch.show.programs.verdicts import VERDICT_STYLES
from lobewatch.show.report.page import make_gauge, render_page, write_page
from lobewatch.show.report.report_data import FREQUENCY_VALUE, ReportData, collect_report_data, make_value_trend
from lobewatch.show.report.section import NumberTable
from lobewatch.show.report.sections import SECTIONS, SectionMakers
from lobewatch.show.terminal.output import JsonObject
from lobewatch.show.terminal.status_labels import status_css_class, status_label
from lobewatch.show.trend import change_text, no_dates_text, rate_text, reach_text, trend_text
from lobewatch.verdicts import Stability

MAX_SUMMARY_REASONS = 3
"""Largest number of reasons and of series in the summary."""
TABLE_REASON_CODES = (
    *("frequency-alarm", "frequency-warn", "decay"),
    *("program-not-stable", "program-doubtful", "program-unknown"),
    "overdue",
)
"""Codes of reasons that the tables of the summary show, unless they are the worst."""


def make_summary(data: ReportData) -> dict[str, Any]:
    """Make the summary as the template takes it."""
    standing, limits = data.outlook.status, data.machine.limits
    worst, levels = standing.series[0], (limits.frequency_warn_percent, limits.frequency_alarm_percent)
    has_changed = worst.drop.is_known and not worst.is_baseline
    return {
        **_status_content(standing),
        "gauge": make_gauge(worst.drop.value, *levels) if has_changed else None,
        "series": [_series_content(series) for series in standing.series[:MAX_SUMMARY_REASONS]],
        "more_series": len(standing.series[MAX_SUMMARY_REASONS:]),
        "tap": _next_tap_text(standing, data.machine),
        "programs": [_program_content(program, data) for program in data.programs],
        "no_dates": no_dates_text(data.outlook),
        "pictures": list(draw_summary_figures(data)),
    }


def _status_content(standing: MachineStatus) -> dict[str, Any]:
    """Return the status in words, the reasons and the next step."""
    first, others = _pick_reasons(standing)
    notable = [remark for remark in others if STATUS_BY_CODE[remark.code] is not StatusLevel.GOOD]
    shown, status = notable[: MAX_SUMMARY_REASONS - 1], (standing.status, standing.is_early)
    words = {"light": status_label(*status), "kind": status_css_class(*status), "next_step": standing.next_step}
    return words | {
        "reasons": [remark.finding for remark in [*first, *shown]],
        "others": [remark.finding for remark in others if remark not in shown],
    }


def _pick_reasons(standing: MachineStatus) -> tuple[list[Remark], list[Remark]]:
    """Return the worst reason, of the series with the largest drop, and those that the summary shows nowhere else."""
    plain, order = set(standing.reasons), {series.name: place for place, series in enumerate(standing.series)}
    alike = [remark for remark in standing.remarks if remark.code == standing.remarks[0].code]
    first = merge_remarks(sorted(alike, key=lambda remark: order.get(remark.about, 0)))[:1]
    beside = [remark for remark in standing.remarks if remark.code not in TABLE_REASON_CODES or remark not in plain]
    return first, [remark for remark in merge_remarks(beside) if remark not in first]


def _series_content(series: SeriesStatus) -> dict[str, str]:
    """Return name, change, trend and rate of a series."""
    if series.is_baseline:
        return {"name": series.name, "change": "first test", "course": "nothing to compare it with yet"}
    trend = series.trend
    course = [] if trend is None else [*filter(None, (trend_text(trend), rate_text(trend)))]
    since = f"since {series.first_time:%Y-%m-%d}"
    return {"name": series.name, "change": change_text(series), "course": "; ".join(course) or since}


def _program_content(program: ProgramAdvice, data: ReportData) -> dict[str, str]:
    name, word, outlook = program.verdict.program.name, program.verdict.stability, data.outlook
    fate, now = outlook.programs.get(name, ProgramForecast(NO_FORECAST, NO_FORECAST)), outlook.status.time
    until = {
        Stability.STABLE: f"doubtful {reach_text(fate.doubtful, now)}",
        Stability.DOUBTFUL: f"not stable {reach_text(fate.not_stable, now)}",
        Stability.NOT_STABLE: "not stable already",
        Stability.UNKNOWN: "not known",
    }
    style = VERDICT_STYLES[word]
    shown = {"name": name, "kind": style.css_class, "word": f"{style.symbol} {word}"}
    return shown | {"until": until[word], "instead": alternative_text(program)}


def alternative_text(program: ProgramAdvice) -> str:
    """Return the recommended speed and depth in a few words."""
    assembly, settings = program.verdict.assembly, (program.advice.best, program.advice.deepest_here)
    if program.verdict.stability is Stability.STABLE:
        return "as it is"
    if program.verdict.stability is Stability.UNKNOWN or assembly is None or not assembly.is_complete:
        return "not known: see below"
    texts = [f"{format_rpm(item.speed_rpm)} rpm, {item.depth_mm:g} mm" for item in settings if item is not None]
    return " or ".join(dict.fromkeys(texts)) or "no safe speed: another tool"


def _next_tap_text(standing: MachineStatus, machine: Machine) -> str:
    left, last = standing.days_left, standing.last_tap
    if left is None or last is None:
        return "now: it was never tapped"
    due = f"{last + timedelta(days=math.floor(machine.machine.tap_interval_days)):%Y-%m-%d}"
    return f"now: overdue since {due}" if left < 0 else f"by {due}"


def draw_summary_figures(data: ReportData) -> Iterator[tuple[str, str]]:
    """Draw the trend of the frequency, or the response of a single tap test, and the lobes where there are any.

    Each is its caption and its <svg> element.
    """
    points, diagram = make_value_trend(data, FREQUENCY_VALUE), data.lobe_diagram
    if points is not None:
        ahead = ", and where it goes" if points.curve is not None else ""
        figure = plot_trend(points, SMALL_FIGURE_SIZE)
        figure.axes[0].set_ylabel("")  # its name is the caption, for letters on a phone are large
        yield f"Natural frequency in {data.last.direction} (Hz){ahead}", render_svg(figure)
    elif (frf := data.newest.frf) is not None:
        figure = plot_frf(None, frf, data.response_band(frf), SMALL_FIGURE_SIZE)
        yield "Receptance at the tool tip", render_svg(figure)
    if diagram is not None:
        then = "; dashed: at first" if len(diagram.depths) > 1 else ""
        yield f"Depth (mm), {diagram.cut}: chatter above the line{then}", render_svg(plot_lobes(diagram, is_small=True))


def write_report(
    logbook: Logbook, path: Path | None = None, tool: str = "", direction: str = "", sections: SectionMakers = SECTIONS
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
    logbook: Logbook, tool: str, direction: str, now: datetime | None = None, sections: SectionMakers = SECTIONS
) -> str:
    """Return the HTML of one series; raise ValueError where it has no tap test. now: None for the current time."""
    return render_page("report.html", **logbook.query(_report_content, tool, direction, now, sections))


def _report_content(
    analysis: Analysis, tool: str, direction: str, now: datetime | None, sections: SectionMakers
) -> JsonObject:
    """Return all that the template shows, from one analysis."""
    data = collect_report_data(analysis, tool, direction, now)
    groups = [make(data) for make in sections]
    return {
        "data": data,
        "groups": groups,
        "has_plots": any(section.has_plot for group in groups for section in group),
        "numbering": count(1),
        "first_screen": make_summary(data),
        "conditions": [*filter(None, [data.newest.circumstances.operator]), *condition_texts(data.last.conditions)],
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
    numbers = NumberTable(FLEET_COLUMNS, [[row[column] for column in FLEET_COLUMNS] for row in rows])
    machines = [_machine_content(row) for row in rows]
    return render_page("fleet.html", name=name, now=now, counts=counts, machines=machines, numbers=numbers)


def _machine_content(row: Mapping[str, Any]) -> JsonObject:
    """Return a machine as the template takes it."""
    left, last, fall, std = row["days_left"], row["last_tap"], row["fall"], row["fall_std"]
    due = "never tapped" if left is None else due_text(left)
    is_good, has_changed = row["light"] is StatusLevel.GOOD, fall is not None and std != 0
    return {
        **row,
        "kind": status_css_class(row["light"], row["is_early"]),
        "reasons": row["reasons"] or [row["why"] or ("all is well" if is_good else "-")],
        "fallen": f"{format_with_error(-fall, std)} %" if has_changed else "nothing to compare with",
        "gauge": make_gauge(fall, *row["limits"]) if has_changed else None,
        "spark": spark_points(row["points"]),
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
    (first, *_, last), percents = zip(*points, strict=True)
    top, span, reach = max(percents), last - first or 1.0, max(max(percents) - min(percents), 1.0)
    return " ".join(
        f"{SPARK_WIDTH * (day - first) / span:.1f},{SPARK_HEIGHT * (top - drop) / reach:.1f}" for day, drop in points
    )
