"""Dates that a level is reached at, as people say them and as JSON."""

from __future__ import annotations

import math

from lobewatch.decay.forecast import DateRange
from lobewatch.decay.trend import date

ASSUMED = "Dates hold if the machine is used as before; an acceleration that is not yet visible cannot be foreseen."


def dates_text(dates: DateRange | None, horizon: float, *, tapped: bool = True) -> str:
    """For people; horizon: days since 1970 up to which was looked; tapped: whether what is past was tapped, too."""
    if dates is None:
        return "history too short or too old"
    if dates.probable == -math.inf:
        return "already" if tapped else "by now, at this rate"
    if dates.earliest == math.inf:
        return f"not before {date(horizon):%Y-%m}"
    if dates.latest == math.inf:
        return f"not before {_day(dates.earliest)}"
    return f"between {_day(dates.earliest)} and {_day(dates.latest)} (80 %), probably {_day(dates.probable)}"


def dates_json(dates: DateRange | None) -> dict[str, str | None]:
    """Dates as "2026-03-01", null where none is known, "already"."""
    named = zip(("p10", "p50", "p90"), dates or (math.inf,) * 3, strict=True)
    return {name: _or_word(days) for name, days in named}


def _day(days: float) -> str:
    return "now" if days == -math.inf else f"{date(days):%Y-%m-%d}"


def _or_word(days: float) -> str | None:
    if math.isfinite(days):
        return f"{date(days):%Y-%m-%d}"
    return "already" if days < 0 else None
