"""A line a machine, as the dashboard, the terminal and other programs take it."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import date, timedelta
from typing import Any

from acquisition import joined
from lobewatch.plant.plant import MachineStanding
from lobewatch.plant.summary import Ahead, SeriesSummary

SHOWN_APART = ("frequency-alarm", "frequency-warn", "overdue")
"""Reasons that stand beside the others as the fall and the date."""
EPOCH = date(1970, 1, 1)


def plant_rows(machines: Sequence[MachineStanding]) -> list[dict[str, Any]]:
    """Rows in the order of the standings; the series is the one that fell most."""
    return [plant_row(machine) for machine in machines]


def plant_row(machine: MachineStanding) -> dict[str, Any]:
    """Row of one machine."""
    summary, dated = machine.summary, machine.dated
    worst = summary.series[0] if summary.series else None
    remarks = joined(dated.remarks)
    reasons = [remark.finding for remark in remarks if remark.code not in SHOWN_APART]
    return {
        "key": machine.key,
        "name": summary.name,
        "light": dated.light,
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
        "next_limit": next_limit(summary.series),
        "has_port": summary.has_port,
        "programs": summary.programs,
        "points": worst.points if worst else (),
        "limits": [limit.percent for limit in worst.limits] if worst else [],
    }


def next_limit(series: Sequence[SeriesSummary]) -> dict[str, Any] | None:
    """The fixed limit that is reached next by any series, with its dates; None where nothing can be foretold.

    A limit that the fall is past already is not ahead; where none is foretold, up to when there is none.
    """
    ahead = [
        limit
        for course in series
        for limit in course.limits
        if limit.foretold_to is not None and not _is_past(course, limit)
    ]
    if not ahead:
        return None
    first = min(ahead, key=_date_order)
    if first.earliest is None:
        first = min(ahead, key=lambda limit: (limit.foretold_to or 0.0, limit.percent))
    named = {"p10": first.earliest, "p50": first.probable, "p90": first.latest, "foretold_to": first.foretold_to}
    return {"percent": first.percent, **{name: _day(days) for name, days in named.items()}}


def _date_order(limit: Ahead) -> tuple[bool, float, float, float]:
    return limit.probable is None, limit.probable or 0.0, limit.earliest or 1e9, limit.percent


def _is_past(course: SeriesSummary, limit: Ahead) -> bool:
    return course.fall is not None and course.fall >= limit.percent


def _day(days: float | None) -> str | None:
    return None if days is None else (EPOCH + timedelta(days=days)).isoformat()
