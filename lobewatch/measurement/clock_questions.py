"""Check the date of a tap test against the clock.

The fleet overview imports this module, so it needs neither numpy nor tap files.
"""

import shlex
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

from acquisition import Remark

FIRST_RELEASE = datetime(2026, 1, 1, tzinfo=UTC)
"""Day before the first release of lobewatch; no test is older."""
MAX_TIME_AHEAD = timedelta(days=1)
"""Largest time ahead that a time zone explains."""
CLOCK_QUESTIONS = {
    "clock-behind": "before the newest test already stored",
    "clock-before-release": f"before the first release of lobewatch ({FIRST_RELEASE:%Y-%m-%d})",
    "clock-ahead": "more than a day in the future",
}
"""Reason of each question about the time of a test, by its code in the journal."""


def is_in_future(time: datetime, now: datetime) -> bool:
    """Tell whether a time is in the future, whatever its time zone."""
    return time - now > MAX_TIME_AHEAD


def clock_question(code: str, time: str) -> Remark:
    """Return the question of a code about the time of a test (ISO 8601); KeyError for an unknown code."""
    when = f"{datetime.fromisoformat(time).astimezone(UTC):%Y-%m-%d %H:%M} UTC"
    text = f"recorded at {when}, {CLOCK_QUESTIONS[code]} (computer clock wrong?)"
    return Remark(code, when, text, "Set the clock, exclude this test and tap again")


def future_tap_remarks(tap_id: str, time: datetime, now: datetime, path: Path | str) -> Iterator[Remark]:
    """Yield a remark on a newest test with a date in the future; path: machine folder."""
    if is_in_future(time, now):
        entry = shlex.join([str(path), tap_id])
        out = f"folder_updates.exclude_entry {entry} exclude_entry.reason 'clock was wrong'"
        cure = f"Set the clock. If the clock was wrong during this test, run {out} and tap again."
        yield Remark("tap-in-future", f"tap test {tap_id}", f"date {time:%Y-%m-%d} is in the future", cure)
