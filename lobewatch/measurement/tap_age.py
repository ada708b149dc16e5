"""Age of tap tests, counted from the clock, and the remarks on old ones.

The fleet overview imports this module, so it needs neither numpy nor tap files.
"""

from datetime import datetime, timedelta

from acquisition import Remark

MAX_TAP_AGE_INTERVALS = 2.0
"""Age of a tap test beyond which it is too old, in tap intervals; chosen, as recommended settings hold so long."""
TOO_OLD_CODE = "tap-too-old"
"""Code of the remark on a tap test beyond an agreed interval."""


def tap_age_days(time: datetime, now: datetime) -> float:
    """Return the age of a tap test (days); negative if the clock is before it."""
    return (now - time) / timedelta(days=1)


def format_age(days: float) -> str:
    """Format an age in whole days.

    >>> format_age(1.9), format_age(-2.1), format_age(-0.1)
    ('1 day old', '2 days in the future', '0 days old')
    """
    whole = int(days)
    return f"{abs(whole)} day{'' if abs(whole) == 1 else 's'} {'in the future' if whole < 0 else 'old'}"


def is_too_old(time: datetime, now: datetime, interval_days: float) -> bool:
    """Tell whether a tap test is older than two tap intervals (days)."""
    return tap_age_days(time, now) > MAX_TAP_AGE_INTERVALS * interval_days


def too_old_remark(about: str, time: datetime, now: datetime, interval_days: float) -> Remark:
    """Return the remark on a tap test that is too old for an agreed interval (days). about: program or tool."""
    interval = f"two tap_interval_days of {interval_days:g} days (older versions of init set 30)"
    return Remark("tap-too-old", about, f"{_age_text(time, now)}, more than {interval}", "Tap again")


def old_remark(about: str, time: datetime, now: datetime) -> Remark:
    """Return the remark on an old tap test where nobody has agreed an interval. about: tool."""
    return Remark("tap-old", about, _age_text(time, now), "Tap again, or set tap_interval_days in machine.toml")


def _age_text(time: datetime, now: datetime) -> str:
    return f"newest tap test in x or y is {format_age(tap_age_days(time, now))}"
