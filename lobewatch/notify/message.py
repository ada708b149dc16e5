"""How a machine stands, as a message for other programs."""

from __future__ import annotations

from datetime import datetime, timedelta

import msgspec

from lobewatch.plant.plant import MachineStanding
from lobewatch.plant.standing_file import software
from lobewatch.show.plant.plant_rows import next_limit

NOT_IN_TOPICS = str.maketrans("+#/\0", "____")
"""What no level of a topic may hold."""


def topic_of(prefix: str, key: str) -> str:
    """Where a machine's message stands; key: name of its folder."""
    return f"{prefix}/{key.translate(NOT_IN_TOPICS)}/standing"


def message_of(one: MachineStanding, now: datetime) -> bytes:
    """JSON; what is not known is null."""
    summary, dated = one.summary, one.dated
    worst = summary.series[0] if summary.series else None
    due = None if summary.time is None else summary.time + timedelta(days=summary.interval_days)
    return msgspec.json.encode(
        {
            "folder": one.key,
            "machine": summary.name,
            "light": dated.light,
            "reasons": [{"code": one.code, "about": one.about, "text": one.text} for one in dated.remarks],
            "next_step": dated.next_step,
            "fall_percent": worst.fall if worst else None,
            "fall_percent_std": worst.fall_std if worst else None,
            "series": worst.name if worst else None,
            "frequency_hz": worst.frequency if worst else None,
            "next_limit": next_limit(summary.series),
            "programs": summary.programs,
            "last_tap": summary.last_tap or None,
            "due": due and due.isoformat(),
            "is_overdue": dated.days_left is not None and dated.days_left < 0,
            "time": now.isoformat(),
            "software": f"lobewatch {software()}",
        }
    )
