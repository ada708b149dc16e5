"""Show the status of many machines: rows for dashboard and report, text and CSV."""

import math
from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any

from acquisition import merge_remarks
from acquisition.errors import join_sentences
from dsm import format_with_error
from lobewatch.fleet.fleet import FleetMachine
from lobewatch.fleet.machine_summary import SeriesSummary
from lobewatch.measurement.tap_age import tap_age_days
from lobewatch.monitoring import threshold_dates
from lobewatch.monitoring.drop_text import describe_drop, format_change
from lobewatch.monitoring.threshold_dates import ThresholdDates, date_of_days
from lobewatch.show.terminal.output import JsonObject, align_columns, count_noun, format_csv, make_printable
from lobewatch.show.terminal.sentences import wrap_lines
from lobewatch.show.terminal.status_labels import status_label, status_name

SEPARATE_REASON_CODE = "overdue"
"""Code of the reason that has a column of its own."""
MAX_SHOWN_REASONS = 4
"""Largest number of reasons below the line of a machine."""


def fleet_rows(machines: Sequence[FleetMachine]) -> list[JsonObject]:
    """Return a row for each machine, in their order."""
    return [fleet_row(machine) for machine in machines]


def fleet_row(machine: FleetMachine) -> JsonObject:
    """Return the row of one machine, with its worst series."""
    summary, dated = machine.summary, machine.current
    ahead = threshold_dates.find_next_limit(summary.limits)
    remarks = merge_remarks(dated.remarks)
    reasons = [remark.finding for remark in remarks if remark.code != SEPARATE_REASON_CODE]
    return {
        "key": machine.key,
        "name": summary.name,
        "light": dated.status,
        "is_early": dated.is_early,
        "word": status_label(dated.status, dated.is_early),
        "can_be_judged": dated.is_readable,
        **_drop_columns(next(iter(summary.series), None)),
        "last_tap": summary.last_tap,
        "days_left": dated.days_left,
        "tap_age_days": None if summary.time is None else int(tap_age_days(summary.time, dated.time)),
        "reasons": reasons,
        "note": join_sentences(*reasons),
        "next_step": dated.next_step,
        "alarms": [alarm.to_row(dated.time) for alarm in summary.alarms],
        "next_limit": threshold_dates.build_limit_row(ahead),
        "limit": next_limit_text(ahead, dated.time),
        "forecast": threshold_dates.build_forecast_rows(summary.forecasts, summary.limits),
        "has_port": summary.has_port,
        "programs": summary.programs_at(dated.time),
        "limits": [percent for percent, _ in summary.limits],
    }


def _drop_columns(worst: SeriesSummary | None) -> JsonObject:
    """Return the drop of the worst series as columns of a row."""
    worst = worst or SeriesSummary("", "", "", None, None, None)
    interval, finding = worst.drop_interval, describe_drop(worst.drop, worst.drop_half_width, is_proven=worst.is_proven)
    columns: JsonObject = {"fall": worst.drop, "fall_std": worst.drop_std, "fall_interval": interval}
    columns |= {"is_change_proven": worst.is_proven, "series": worst.name, "points": worst.points}
    return columns | {"change": _change_cell(columns), "finding": finding}


def half_width_of(row: Mapping[str, Any]) -> float | None:
    """Return half the width of the 95 % interval of the drop of a row (%); None if unknown."""
    low, high = row["fall_interval"] or (None, None)
    return None if low is None else (high - low) / 2


def has_comparison(row: Mapping[str, Any]) -> bool:
    """Return whether a row has a drop from an earlier test."""
    return row["fall"] is not None and half_width_of(row) != 0


def _change_cell(row: Mapping[str, Any]) -> str:
    """Return the frequency change of a row in a table."""
    if has_comparison(row):
        return format_change(row["fall"], half_width_of(row))
    return "" if row["fall"] is None else "first test"


def next_limit_text(limit: tuple[float, ThresholdDates] | None, now: datetime) -> str:
    """Return the next fixed limit, such as "5 %: 2026-11 to 2027-02"; empty without a forecast."""
    if limit is None:
        return ""
    percent, reach = limit
    first, last = _month_text(reach.earliest or reach.forecast_end), _month_text(reach.latest)
    when = first if first == last else f"{first} to {last}" if last else f"not before {first}"
    is_past = reach.latest is not None and reach.latest <= now.timestamp() / 86400
    return f"{percent:g} %: {'by now at this rate' if is_past else when}"


def _month_text(days: float | None) -> str:
    return "" if days is None else f"{date_of_days(days):%Y-%m}"


FLEET_COLUMNS = ("key", "name", "light", "fall", "fall_std", "series", "last_tap", "days_left", "note", "next_step")
"""Keys of a row that are columns of the CSV, in order."""


def fleet_text(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return a line for each machine, with the next step and a list of the reasons below it."""
    headings = "machine", "status", "f1 drop (%)", "last tap test", "next limit"
    first, *lines = align_columns([headings, *map(_fleet_cells, rows)])
    parts = (part for line, row in zip(lines, rows, strict=True) for part in (line, *_machine_notes(row)))
    return "\n".join([first, *parts])


def fleet_csv(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return a CSV line for each machine, below the headings."""
    return format_csv([FLEET_COLUMNS, *([row[name] for name in FLEET_COLUMNS] for row in rows)])


def due_text(days_left: float) -> str:
    """Return when the next tap test is due."""
    return f"in {math.floor(days_left)} d" if days_left >= 0 else f"{math.ceil(-days_left)} d overdue"


def _fleet_cells(row: Mapping[str, Any]) -> tuple[str, ...]:
    light = f"{'early ' if row['is_early'] else ''}{status_name(row['light'])}"
    drop = format_with_error(row["fall"], half_width_of(row)) if has_comparison(row) else row["change"]
    due, left = "", row["days_left"]
    if left is not None:
        last = f"{datetime.fromisoformat(row['last_tap']).astimezone():%Y-%m-%d}"
        due = f"{last}, {'due ' if left >= 0 else ''}{due_text(left)}"
    return _to_one_line(row["key"]), light, drop, due, row["limit"]


def _machine_notes(row: Mapping[str, Any]) -> list[str]:
    """Return the name of a machine if the folder has another, the next step, and the reasons."""
    named = [f"Name: {row['name']}"] if row["name"] != row["key"] else []
    reasons = row["reasons"]
    shown, further = reasons[:MAX_SHOWN_REASONS], len(reasons) - MAX_SHOWN_REASONS
    more = [f"{count_noun(further, 'more reason')} (see the report)"] if further > 0 else []
    return wrap_lines([*named, f"Next: {row['next_step']}", *shown, *more])


def _to_one_line(text: str) -> str:
    return make_printable(text).replace("\n", " ").replace("\t", " ")
