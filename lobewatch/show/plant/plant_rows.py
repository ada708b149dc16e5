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


def plant_rows(found: Sequence[MachineStanding]) -> list[dict[str, Any]]:
    """In the order of the standings; the series is the one that fell most."""
    return [plant_row(one) for one in found]


def plant_row(one: MachineStanding) -> dict[str, Any]:
    """Of one machine."""
    summary, dated = one.summary, one.dated
    worst = summary.series[0] if summary.series else None
    told = joined(dated.remarks)
    reasons = [one.finding for one in told if one.code not in SHOWN_APART]
    return {
        "key": one.key,
        "name": summary.name,
        "light": dated.light,
        "fall": worst.fall if worst else None,
        "fall_std": worst.fall_std if worst else None,
        "series": worst.name if worst else "",
        "last_tap": summary.last_tap,
        "days_left": dated.days_left,
        "reasons": reasons,
        "note": "; ".join(reasons),
        "why": "; ".join(one.finding for one in told if one.code != "overdue"),
        "next_step": dated.next_step,
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
        one for course in series for one in course.limits if one.foretold_to is not None and not _is_past(course, one)
    ]
    if not ahead:
        return None
    first = min(ahead, key=lambda one: (one.probable is None, one.probable or 0.0, one.earliest or 1e9, one.percent))
    if first.earliest is None:
        first = min(ahead, key=lambda one: (one.foretold_to or 0.0, one.percent))
    named = {"p10": first.earliest, "p50": first.probable, "p90": first.latest, "foretold_to": first.foretold_to}
    return {"percent": first.percent, **{name: _day(days) for name, days in named.items()}}


def _is_past(course: SeriesSummary, limit: Ahead) -> bool:
    return course.fall is not None and course.fall >= limit.percent


def _day(days: float | None) -> str | None:
    return None if days is None else (EPOCH + timedelta(days=days)).isoformat()
