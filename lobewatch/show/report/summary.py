"""Make the summary at the top of the report."""

from __future__ import annotations

import math
from collections.abc import Iterator
from datetime import datetime, timedelta
from typing import Any, NamedTuple

from acquisition import Remark, merge_remarks
from lobewatch.machine import Machine
from lobewatch.monitoring import MachineStatus, SeriesStatus
from lobewatch.monitoring.status_rules import STATUS_BY_CODE, StatusLevel
from lobewatch.monitoring.threshold_dates import NO_FORECAST, ProgramForecast
from lobewatch.show.figures.drawing import render_svg
from lobewatch.show.figures.lobe_figures import SMALL_FIGURE_SIZE
from lobewatch.show.figures.trend_figures import plot_frf
from lobewatch.show.programs.advice import ProgramAdvice, format_rpm
from lobewatch.show.programs.verdicts import VERDICT_STYLES
from lobewatch.show.report.page import make_gauge
from lobewatch.show.report.report_data import FREQUENCY_VALUE, ReportData, make_value_trend
from lobewatch.show.terminal.status_labels import status_css_class, status_label
from lobewatch.show.trend import change_text, no_dates_text, rate_text, reach_text, trend_text
from lobewatch.verdicts import Stability

UNKNOWN_FATE = ProgramForecast(NO_FORECAST, NO_FORECAST)
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
    worst = standing.series[0]
    return {
        **_status_content(standing),
        "gauge": make_gauge(worst.drop.value, limits.frequency_warn_percent, limits.frequency_alarm_percent)
        if _has_changed(worst)
        else None,
        "series": [_series_content(series) for series in standing.series[:MAX_SUMMARY_REASONS]],
        "more_series": len(standing.series[MAX_SUMMARY_REASONS:]),
        "programs": [_program_content(program, data) for program in data.programs],
        "no_dates": no_dates_text(data.outlook),
        "tap": _next_tap_text(standing, data.machine),
        "pictures": list(draw_summary_figures(data)),
    }


def _status_content(standing: MachineStatus) -> dict[str, Any]:
    """Return the status in words, the reasons and the next step."""
    first, others = _pick_reasons(standing)
    shown = [remark for remark in others if STATUS_BY_CODE[remark.code] is not StatusLevel.GOOD][
        : MAX_SUMMARY_REASONS - 1
    ]
    return {
        "light": status_label(standing.status, standing.is_early),
        "kind": status_css_class(standing.status, standing.is_early),
        "reasons": [remark.finding for remark in [*first, *shown]],
        "others": [remark.finding for remark in others if remark not in shown],
        "next_step": standing.next_step,
    }


def _pick_reasons(standing: MachineStatus) -> tuple[list[Remark], list[Remark]]:
    """Return the worst reason, of the series with the largest drop, and those that the summary shows nowhere else."""
    plain, order = set(standing.reasons), {series.name: place for place, series in enumerate(standing.series)}
    alike = [remark for remark in standing.remarks if remark.code == standing.remarks[0].code]
    first = merge_remarks(sorted(alike, key=lambda remark: order.get(remark.about, 0)))[:1]
    beside = [remark for remark in standing.remarks if remark.code not in TABLE_REASON_CODES or remark not in plain]
    return first, [remark for remark in merge_remarks(beside) if remark not in first]


def _has_changed(series: SeriesStatus) -> bool:
    return series.drop.is_known and not series.is_baseline


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
    return {
        "name": name,
        "kind": VERDICT_STYLES[word].css_class,
        "word": f"{VERDICT_STYLES[word].symbol} {word}",
        "until": _until_text(word, outlook.programs.get(name, UNKNOWN_FATE), outlook.status.time),
        "instead": alternative_text(program),
    }


def _until_text(word: Stability, fate: ProgramForecast, now: datetime) -> str:
    if word is Stability.STABLE:
        return f"doubtful {reach_text(fate.doubtful, now)}"
    if word is Stability.DOUBTFUL:
        return f"not stable {reach_text(fate.not_stable, now)}"
    return "not stable already" if word is Stability.NOT_STABLE else "not known"


def alternative_text(program: ProgramAdvice) -> str:
    """Return the recommended speed and depth in a few words."""
    assembly, settings = program.verdict.assembly, (program.advice.best, program.advice.deepest_here)
    if program.verdict.stability is Stability.STABLE:
        return "as it is"
    if program.verdict.stability is Stability.UNKNOWN or assembly is None or not assembly.is_complete:
        return "not known: see below"
    texts = [
        f"{format_rpm(setting.speed_rpm)} rpm, {setting.depth_mm:g} mm" for setting in settings if setting is not None
    ]
    return " or ".join(dict.fromkeys(texts)) or "no safe speed: another tool"


def _next_tap_text(standing: MachineStatus, machine: Machine) -> str:
    left, last = standing.days_left, standing.last_tap
    if left is None or last is None:
        return "now: it was never tapped"
    due = f"{last + timedelta(days=math.floor(machine.machine.tap_interval_days)):%Y-%m-%d}"
    return f"now: overdue since {due}" if left < 0 else f"by {due}"


class SummaryFigure(NamedTuple):
    """Small figure of the summary."""

    caption: str
    """Caption of the figure."""
    svg: str
    """The <svg> element."""


def draw_summary_figures(data: ReportData) -> Iterator[SummaryFigure]:
    """Draw the trend of the frequency, or the response of a single tap test, and the lobes where there are any."""
    points, diagram = make_value_trend(data, FREQUENCY_VALUE), data.lobe_diagram
    if points is not None:
        ahead = ", and where it goes" if points.curve is not None else ""
        caption = f"Natural frequency in {data.last.direction} (Hz){ahead}"
        figure = points.figure(SMALL_FIGURE_SIZE)
        figure.axes[0].set_ylabel("")  # its name is the caption, for letters on a phone are large
        yield SummaryFigure(caption, render_svg(figure))
    elif (frf := data.newest.frf) is not None:
        figure = plot_frf(None, frf, data.response_band(frf), SMALL_FIGURE_SIZE)
        yield SummaryFigure("Receptance at the tool tip", render_svg(figure))
    if diagram is not None:
        then = "; dashed: at first" if len(diagram.depths) > 1 else ""
        caption = f"Depth (mm), {diagram.cut}: chatter above the line{then}"
        yield SummaryFigure(caption, render_svg(diagram.figure(is_small=True)))
