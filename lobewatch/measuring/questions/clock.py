"""Whether the clock of the computer was right when a live test was taken; asked once, when it is committed."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING

from acquisition import Remark

if TYPE_CHECKING:  # else each look at a plant would wait for what reads tap files
    from lobewatch.machine import TapEntry

BEHIND, TOO_OLD, AHEAD = CLOCK_QUESTIONS = ("clock-behind", "clock-before-release", "clock-ahead")
"""Codes, as they stand in the journal line of the test."""
RELEASED = datetime(2026, 1, 1, tzinfo=UTC)
"""There was no release of lobewatch before."""
RESUMED = timedelta(hours=12)
"""An interrupted test keeps its time; so much later it may be gone on with, after others were taken."""
FAR = timedelta(days=1)
"""A time farther ahead than any time zone accounts for."""


def clock_questions(created: datetime, now: datetime | None, taps: Iterable[TapEntry]) -> tuple[str, ...]:
    """What is asked of a test of this time, by code; now: when a live one is committed, None for any other."""
    if now is None:
        return ()
    newest = max((datetime.fromisoformat(tap.time) for tap in taps if not tap.excluded), default=None)
    behind = newest is not None and (now < newest or created < newest - RESUMED)
    asked = {BEHIND: behind, TOO_OLD: created < RELEASED, AHEAD: is_ahead(created, now)}
    return tuple(code for code, is_asked in asked.items() if is_asked)


def is_ahead(time: datetime, now: datetime) -> bool:
    """Whether a time lies in the future, whatever its zone."""
    return time - now > FAR


def about_clock(code: str, time: str) -> Remark:
    """The question of a code; time: of the test (ISO 8601)."""
    why = {
        BEHIND: "before the newest test that was there",
        TOO_OLD: f"before the first release of this program, {RELEASED:%Y-%m-%d}",
        AHEAD: "more than a day in the future",
    }[code]
    when = f"{datetime.fromisoformat(time).astimezone(UTC):%Y-%m-%d %H:%M} UTC"
    cure = "put the clock of the computer right and tap again; exclude the test with the wrong time"
    return Remark(code, when, f"its time, {when}, is {why}: was the clock of the computer right?", cure)


def about_future(tap_id: str, time: datetime, now: datetime, path: Path | str) -> Iterator[Remark]:
    """That the newest test is one of the future: the clock was wrong then, or is now. path: of the folder."""
    if is_ahead(time, now):
        out = shlex.join(["lobewatch", "exclude", str(path), tap_id, "--reason", "clock was wrong"])
        cure = f"Put the clock right; if it was wrong at that test, take it out and tap again: {out}"
        yield Remark("tap-in-future", f"tap test {tap_id}", f"dated {time:%Y-%m-%d}, in the future", cure)
