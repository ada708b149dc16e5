"""Words for a drop and for the next limit."""

from datetime import UTC, datetime

import pytest

from lobewatch.monitoring.drop_text import describe_drop, format_change
from lobewatch.monitoring.threshold_dates import ThresholdDates
from lobewatch.show.fleet.fleet_status import next_limit_text

NOW = datetime(2026, 1, 15, tzinfo=UTC)
TODAY = NOW.timestamp() / 86400


def finding(drop: float, half_width: float, *, is_proven: bool = False) -> str:
    return describe_drop(drop, half_width, is_proven=is_proven).replace(format_change(drop, half_width), "")


@pytest.mark.parametrize("sign", [-1, 1])
def test_a_change_outside_its_interval_is_neither_proven_nor_absent(sign: int) -> None:
    inside, between, beyond = (
        finding(0.83 * sign, 0.84),
        finding(2 * sign, 0.84),
        finding(2 * sign, 0.84, is_proven=True),
    )
    assert len({inside, between, beyond}) == 3
    assert inside == finding(0.0, 0.84)
    assert between == finding(0.85 * sign, 0.84)


@pytest.mark.parametrize(("days", "months"), [(5, ["2026-02"]), (40, ["2026-02", "2026-03"])])
def test_the_next_limit_within_one_month_is_one_month(days: int, months: list[str]) -> None:
    reach = ThresholdDates(False, TODAY + 18, TODAY + 20, TODAY + 18 + days, TODAY + 1000)
    assert [word for word in next_limit_text((5.0, reach), NOW).split() if word[0] == "2"] == months
