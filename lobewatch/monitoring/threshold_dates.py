"""Forecast dates at which a threshold is reached.

The one form in which dates go to people, files and other programs.
"""

from collections.abc import Mapping, Sequence
from datetime import UTC, date, datetime, timedelta
from math import inf

import msgspec


class ThresholdDates(msgspec.Struct, frozen=True, rename={"forecast_end": "foretold_to"}):
    """Dates at which a threshold is reached, in days since 1970; may be past if no test was made since."""

    is_measured: bool = False
    """True if tap tests show that it is reached already."""
    earliest: float | None = None
    """Date at a probability of 10 %; None if not before `forecast_end`."""
    probable: float | None = None
    """Date at a probability of 50 %; None if not before `forecast_end`."""
    latest: float | None = None
    """Date at a probability of 90 %; None if not before `forecast_end`."""
    forecast_end: float | None = msgspec.field(default=None, name="foretold_to")
    """Last checked day; None if no forecast is possible."""

    @property
    def is_known(self) -> bool:
        """True if a date or a forecast exists."""
        return self.is_measured or self.forecast_end is not None

    def to_row(self) -> dict[str, str | None]:
        """Return the fields p10, p50, p90 for other programs: a date, null where none is in sight, or "already"."""
        dates = zip(("p10", "p50", "p90"), (self.earliest, self.probable, self.latest), strict=True)
        return {name: "already" if self.is_measured else _iso_date(days) for name, days in dates}


class ProgramForecast(msgspec.Struct, frozen=True):
    """Forecast of one program."""

    doubtful: ThresholdDates
    """Dates at which it becomes doubtful."""
    not_stable: ThresholdDates
    """Dates at which it becomes not stable."""


NO_FORECAST = ThresholdDates()
ALREADY_REACHED = ThresholdDates(is_measured=True)
LimitForecasts = tuple[tuple[float, ThresholdDates], ...]
"""Fixed limits (%) of machine.toml, each with the dates at which the worst series reaches it."""


def find_earliest(reaches: Sequence[ThresholdDates]) -> ThresholdDates:
    """Return the earliest of several; unknown if the others have no date and one is unknown."""
    if ALREADY_REACHED in reaches:
        return ALREADY_REACHED
    known = [reach for reach in reaches if reach.is_known]
    if not known:
        return NO_FORECAST
    rows = ((reach.earliest, reach.probable, reach.latest, reach.forecast_end) for reach in known)
    columns = ([day for day in days if day is not None] for days in zip(*rows, strict=True))
    first = ThresholdDates(False, *(min(days, default=None) for days in columns))
    return first if len(known) == len(reaches) or first.earliest is not None else NO_FORECAST


def build_forecast_rows(
    fates: Mapping[str, ProgramForecast], limits: LimitForecasts
) -> dict[str, dict[str, dict[str, str | None]]]:
    """Return all dates of a machine for other programs, by program and by limit ("10 %")."""
    rows = {name: {"doubtful": f.doubtful.to_row(), "not stable": f.not_stable.to_row()} for name, f in fates.items()}
    return rows | {f"{percent:g} %": {"reached": reach.to_row()} for percent, reach in limits}


def find_next_limit(limits: LimitForecasts) -> tuple[float, ThresholdDates] | None:
    """Return the limit that is reached next, or None.

    Where none is in sight: the lowest of them.
    """
    ahead = ((percent, reach) for percent, reach in limits if reach.forecast_end is not None)
    return min(ahead, key=lambda limit: (limit[1].probable or inf, limit[1].earliest or inf, limit[0]), default=None)


def build_limit_row(limit: tuple[float, ThresholdDates] | None) -> dict[str, float | str | None] | None:
    """Return a limit as fields for other programs."""
    if limit is None:
        return None
    percent, reach = limit
    return {"percent": percent, **reach.to_row(), "foretold_to": _iso_date(reach.forecast_end)}


def _iso_date(days: float | None) -> str | None:
    return None if days is None else (date(1970, 1, 1) + timedelta(days=days)).isoformat()


def date_of_days(days: float) -> datetime:
    """Return the date of a number of days since 1970."""
    return datetime.fromtimestamp(86400 * days, UTC)
