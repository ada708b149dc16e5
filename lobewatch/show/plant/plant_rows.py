"""A line a machine, as the dashboard, the terminal and other programs take it."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, timedelta
from typing import Any

from acquisition import joined
from lobewatch.decay.reach import EPOCH, Reach, forecast_rows, limit_row, next_limit
from lobewatch.plant.plant import MachineStanding
from lobewatch.show.terminal.light_words import light_word

SHOWN_APART = ("frequency-alarm", "frequency-warn", "overdue")
"""Reasons that stand beside the others as the fall and the date."""


def plant_rows(machines: Sequence[MachineStanding]) -> list[dict[str, Any]]:
    """Rows in the order of the standings; the series is the one that fell most."""
    return [plant_row(machine) for machine in machines]


def plant_row(machine: MachineStanding) -> dict[str, Any]:
    """Row of one machine."""
    summary, dated = machine.summary, machine.dated
    ahead = next_limit(summary.limits)
    worst = summary.series[0] if summary.series else None
    remarks = joined(dated.remarks)
    reasons = [remark.finding for remark in remarks if remark.code not in SHOWN_APART]
    return {
        "key": machine.key,
        "name": summary.name,
        "light": dated.light,
        "is_early": dated.is_early,
        "word": light_word(dated.light, dated.is_early),
        "can_be_judged": dated.can_be_judged,
        "fall": worst.fall if worst else None,
        "fall_std": worst.fall_std if worst else None,
        "series": worst.name if worst else "",
        "last_tap": summary.last_tap,
        "days_left": dated.days_left,
        "reasons": reasons,
        "note": "; ".join(reasons),
        "why": "; ".join(remark.finding for remark in remarks if remark.code != "overdue"),
        "next_step": dated.next_step,
        "alarms": [alarm.row(dated.time) for alarm in summary.alarms],
        "next_limit": limit_row(ahead),
        "limit": limit_text(ahead, dated.time),
        "forecast": forecast_rows(summary.fates, summary.limits),
        "has_port": summary.has_port,
        "programs": summary.programs,
        "points": worst.points if worst else (),
        "limits": [percent for percent, _ in summary.limits],
    }


def limit_text(limit: tuple[float, Reach] | None, now: datetime) -> str:
    """The fixed limit that is reached next: "5 %: 2026-11 to 2027-02"; empty where nothing can be foretold."""
    if limit is None:
        return ""
    percent, reach = limit
    first, last = _month(reach.earliest or reach.foretold_to), _month(reach.latest)
    when = f"{first} to {last}" if last else f"not before {first}"
    is_past = reach.latest is not None and reach.latest <= now.timestamp() / 86400
    return f"{percent:g} %: {'by now, at this rate' if is_past else when}"


def _month(days: float | None) -> str:
    return "" if days is None else f"{EPOCH + timedelta(days=days):%Y-%m}"
