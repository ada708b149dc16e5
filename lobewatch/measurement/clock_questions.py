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
    "clock-behind": "before the newest test that was there",
    "clock-before-release": f"before the first release of this program, {FIRST_RELEASE:%Y-%m-%d}",
    "clock-ahead": "more than a day in the future",
}
"""Reason of each question about the time of a test, by its code in the journal."""


def is_in_future(time: datetime, now: datetime) -> bool:
    """Tell whether a time is in the future, whatever its time zone."""
    return time - now > MAX_TIME_AHEAD


def clock_question(code: str, time: str) -> Remark:
    """Return the question of a code about the time of a test (ISO 8601); KeyError for an unknown code."""
    when = f"{datetime.fromisoformat(time).astimezone(UTC):%Y-%m-%d %H:%M} UTC"
    cure = "put the clock of the computer right and tap again; exclude the test with the wrong time"
    text = f"its time, {when}, is {CLOCK_QUESTIONS[code]}: was the clock of the computer right?"
    return Remark(code, when, text, cure)


def future_tap_remarks(tap_id: str, time: datetime, now: datetime, path: Path | str) -> Iterator[Remark]:
    """Yield a remark on a newest test with a date in the future; path: machine folder."""
    if is_in_future(time, now):
        entry = shlex.join([str(path), tap_id])
        out = f"folder_updates.exclude_entry {entry} exclude_entry.reason 'clock was wrong'"
        cure = f"Put the clock right; if it was wrong at that test, take it out and tap again: {out}"
        yield Remark("tap-in-future", f"tap test {tap_id}", f"dated {time:%Y-%m-%d}, in the future", cure)
