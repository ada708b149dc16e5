"""Age of a tap test: from the clock, too old beyond two intervals."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta, timezone

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lobewatch.measurement.tap_age import format_age, is_too_old, old_remark, tap_age_days, too_old_remark

pytestmark = pytest.mark.quick
TAPPED = datetime(2026, 1, 15, 9, tzinfo=UTC)


@given(days=st.floats(-1000, 4000), interval=st.floats(0.5, 400), offset=st.integers(-12, 14))
def test_age_counts_days_in_any_time_zone(days: float, interval: float, offset: int) -> None:
    now = (TAPPED + timedelta(days=days)).astimezone(timezone(timedelta(hours=offset)))
    assert tap_age_days(TAPPED, now) == pytest.approx(days, abs=1e-9)
    if abs(days - 2 * interval) > 1e-6:
        assert is_too_old(TAPPED, now, interval) is (days > 2 * interval)


def test_two_intervals_are_not_too_old() -> None:
    assert not is_too_old(TAPPED, TAPPED + timedelta(days=60), 30.0)
    assert is_too_old(TAPPED, TAPPED + timedelta(days=60, seconds=1), 30.0)


def test_an_age_counts_whole_days_on_both_sides_of_now() -> None:
    ages = (0.0, -0.5, 0.9, 1.5, -1.5, 400.9, -20785.2)
    words = [format_age(age).split()[0] for age in ages]
    assert words == ["0", "0", "0", "1", "1", "400", "20785"]
    assert format_age(-0.5) == format_age(0.5) != format_age(1.5)
    assert "days" not in format_age(1.5) + format_age(-1.5)
    assert format_age(-2.0) != format_age(2.0)


def test_remarks_name_the_age_in_whole_days() -> None:
    now = TAPPED + timedelta(days=400.9)
    too_old, old = too_old_remark("A", TAPPED, now, 30.0), old_remark("reference", TAPPED, now)
    assert (too_old.code, too_old.about, old.code) == ("tap-too-old", "A", "tap-old")
    assert "400 days" in too_old.text
    assert "30 days" in too_old.text
    assert "400 days" in old.text
    assert "tap_interval_days" in old.cure
