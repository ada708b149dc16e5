"""When something is reached: it is already, it is foretold between dates, or nobody can tell.

The one form in which dates go to people, files and other programs.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from datetime import date, timedelta

import msgspec

EPOCH = date(1970, 1, 1)
INF = math.inf


class Reach(msgspec.Struct, frozen=True):
    """When a level is reached, in days since 1970; it may be past where nobody has tapped since."""

    is_measured: bool = False
    """Whether tap tests show it: it is reached already."""
    earliest: float | None = None
    """At a probability of 10 %; None where not before `foretold_to`."""
    probable: float | None = None
    """At 50 %; None likewise."""
    latest: float | None = None
    """At 90 %; None likewise."""
    foretold_to: float | None = None
    """Last day that was looked at; None where nothing can be foretold."""

    @property
    def is_known(self) -> bool:
        """Whether anything can be said of it."""
        return self.is_measured or self.foretold_to is not None

    def row(self) -> dict[str, str | None]:
        """As other programs take it: p10, p50, p90, each a date, null where none is in sight, "already"."""
        dates = zip(("p10", "p50", "p90"), (self.earliest, self.probable, self.latest), strict=True)
        return {name: "already" if self.is_measured else _iso(days) for name, days in dates}


class Fate(msgspec.Struct, frozen=True):
    """What becomes of one program."""

    doubtful: Reach
    """When it becomes doubtful."""
    not_stable: Reach
    """When it becomes not stable."""


NOBODY_KNOWS = Reach()
ALREADY = Reach(is_measured=True)
Limits = tuple[tuple[float, Reach], ...]
"""Fixed limits (%) of machine.toml, each with when the worst series has fallen by it."""


def earliest_of(reaches: Sequence[Reach]) -> Reach:
    """The earliest of several; where nobody can tell of one of them, that none is in sight is not known."""
    if ALREADY in reaches:
        return ALREADY
    known = [reach for reach in reaches if reach.is_known]
    if not known:
        return NOBODY_KNOWS
    rows = ((reach.earliest, reach.probable, reach.latest, reach.foretold_to) for reach in known)
    first = Reach(
        False, *(min((day for day in days if day is not None), default=None) for days in zip(*rows, strict=True))
    )
    return first if len(known) == len(reaches) or first.earliest is not None else NOBODY_KNOWS


def forecast_rows(fates: Mapping[str, Fate], limits: Limits) -> dict[str, dict[str, dict[str, str | None]]]:
    """All dates of a machine as other programs take them: by program and by limit ("10 %")."""
    programs = {
        name: {"doubtful": fate.doubtful.row(), "not stable": fate.not_stable.row()} for name, fate in fates.items()
    }
    return programs | {f"{percent:g} %": {"reached": reach.row()} for percent, reach in limits}


def next_limit(limits: Limits) -> tuple[float, Reach] | None:
    """The fixed limit that is reached next; None where none is ahead, or nobody can tell.

    Where none is in sight: the lowest of them.
    """
    ahead = ((percent, reach) for percent, reach in limits if reach.foretold_to is not None)
    return min(ahead, key=lambda limit: (limit[1].probable or INF, limit[1].earliest or INF, limit[0]), default=None)


def limit_row(limit: tuple[float, Reach] | None) -> dict[str, float | str | None] | None:
    """A limit as other programs take it."""
    if limit is None:
        return None
    percent, reach = limit
    return {"percent": percent, **reach.row(), "foretold_to": _iso(reach.foretold_to)}


def _iso(days: float | None) -> str | None:
    return None if days is None else (EPOCH + timedelta(days=days)).isoformat()
