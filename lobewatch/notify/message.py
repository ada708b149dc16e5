"""The message on one machine: its topic, and its content as JSON."""

from __future__ import annotations

from datetime import datetime, timedelta
from typing import Any

import msgspec

from lobewatch.decay.reach import forecast_rows, limit_row, next_limit
from lobewatch.plant.plant import MachineStanding
from lobewatch.plant.standing_file import software

NOT_IN_TOPICS = str.maketrans("+#/\0", "____")
"""Characters that no level of a topic may hold, each replaced."""


def topic_of(prefix: str, key: str) -> str:
    """Topic of the message of a machine; key: name of its folder."""
    return f"{prefix}/{key.translate(NOT_IN_TOPICS)}/standing"


def message_of(standing: MachineStanding, now: datetime) -> bytes:
    """Standing of a machine for other programs, as JSON; what is not known is null."""
    return msgspec.json.encode(content_of(standing) | {"time": now.isoformat(), "software": f"lobewatch {software()}"})


def content_of(standing: MachineStanding) -> dict[str, Any]:
    """The message without the time at which it is sent."""
    summary, dated = standing.summary, standing.dated
    worst = summary.series[0] if summary.series else None
    due = None if summary.time is None else summary.time + timedelta(days=summary.interval_days)
    return {
        "folder": standing.key,
        "machine": summary.name,
        "light": dated.light,
        "is_early": dated.is_early,
        "reasons": [{"code": remark.code, "about": remark.about, "text": remark.text} for remark in dated.remarks],
        "alarms": [alarm.row(dated.time) for alarm in summary.alarms],
        "next_step": dated.next_step,
        "fall_percent": worst.fall if worst else None,
        "fall_percent_std": worst.fall_std if worst else None,
        "series": worst.name if worst else None,
        "frequency_hz": worst.frequency if worst else None,
        "next_limit": limit_row(next_limit(summary.limits)),
        "forecast": forecast_rows(summary.fates, summary.limits),
        "programs": summary.programs,
        "last_tap": summary.last_tap or None,
        "due": due and due.isoformat(),
        "is_overdue": dated.days_left is not None and dated.days_left < 0,
    }
