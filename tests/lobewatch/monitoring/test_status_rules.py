"""Test the rules of the machine status: limits, order of the series, and the words of each remark."""

from __future__ import annotations

from datetime import timedelta
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition import Remark
from lobewatch.history.history import History, HistoryRow
from lobewatch.measurement.estimate import Estimate
from lobewatch.monitoring import StatusLevel
from lobewatch.monitoring.machine_status import MachineStatus, assess_status, scatter_remarks
from lobewatch.monitoring.status_rules import STATUS_BY_CODE, date_remarks, sort_by_severity
from lobewatch.monitoring.trend import TapValue, fit_trend
from tests.lobewatch.conftest import START

Floats = NDArray[np.float64]
pytestmark = pytest.mark.quick
SCATTER = 0.1 * np.array([1, -1, 1, 1, -1, -1, 1, -1] * 3)
"""Scatter of 24 points."""


@pytest.fixture(scope="module")
def mill(tmp_path_factory: pytest.TempPathFactory, new_shop: Any) -> Any:
    return new_shop(tmp_path_factory.mktemp("rules") / "m").folder.machine


def monthly_rows(direction: str, frequency: Floats, stiffness: Floats | None = None) -> list[HistoryRow]:
    """Return a test a month with these values (%)."""
    rigid = np.zeros(frequency.size) if stiffness is None else stiffness
    times = [START + timedelta(days=30 * i) for i in range(frequency.size)]
    return [
        HistoryRow(
            f"{direction} {i}",
            time,
            "reference",
            direction,
            Estimate(17 * (100 + f), 0.1),
            stiffness=Estimate(1e5 * (100 + k), 1e3),
        )
        for i, (time, f, k) in enumerate(zip(times, frequency, rigid, strict=True))
    ]


def status(mill: Any, *series: list[HistoryRow]) -> MachineStatus:
    rows = sorted((row for rows in series for row in rows), key=lambda row: row.time)
    return assess_status(mill, History("", "", tuple(rows)), rows[-1].time)


def findings(found: MachineStatus) -> dict[str, Remark]:
    return {remark.code: remark for remark in found.remarks}


@pytest.mark.parametrize(
    ("drop", "code"), [(4.9, ""), (5.1, "frequency-warn"), (9.9, "frequency-warn"), (10.1, "frequency-alarm")]
)
def test_a_limit_is_reached_at_its_drop(mill: Any, drop: float, code: str) -> None:
    found = findings(status(mill, monthly_rows("x", np.array([0.0, -drop]))))
    assert {"frequency-warn", "frequency-alarm"} & found.keys() == ({code} if code else set())


def test_the_series_of_the_most_severe_remark_is_first_and_a_good_one_has_no_rank(mill: Any) -> None:
    y, newest = monthly_rows("y", np.array([0.0, -4.0])), np.arange(21) == 20
    low = status(mill, monthly_rows("x", SCATTER[:21] - 3 * newest), y)
    assert "decay-doubtful" in findings(low)
    assert [one.direction for one in low.series] == ["x", "y"]
    high = status(mill, monthly_rows("x", SCATTER[:21] + 3 * newest), y)
    assert "newest-test-high" in findings(high)
    assert [one.direction for one in high.series] == ["y", "x"]
    calm = status(mill, monthly_rows("x", np.array([0.0, -1.0])), y)
    assert [one.direction for one in calm.series] == ["y", "x"]


@pytest.mark.parametrize("code", ["newest-test-high", "scatter-correlated", "scatter-groups", "frequency-rose"])
def test_a_finding_that_is_no_damage_leaves_the_status_good(code: str) -> None:
    assert STATUS_BY_CODE[code] is StatusLevel.GOOD


def test_a_limit_comes_before_a_drop_that_another_clamping_must_confirm() -> None:
    codes = "decay-doubtful", "frequency-warn", "decay", "frequency-alarm", "first-test-differs"
    order = [remark.code for remark in sort_by_severity(Remark(code, "", "") for code in codes)]
    assert order == ["frequency-alarm", "decay", "frequency-warn", "decay-doubtful", "first-test-differs"]


@pytest.mark.parametrize(("away", "side"), [(3.0, "3.0 % above"), (-3.0, "3.0 % below")])
def test_a_first_test_that_differs_has_its_side(mill: Any, away: float, side: str) -> None:
    y = np.concatenate([[away], 0.5 * SCATTER[:16]])
    text = findings(status(mill, monthly_rows("x", y)))["first-test-differs"].text
    distance = float(text.partition(" is ")[2].partition(" %")[0])
    assert distance == pytest.approx(3.0, abs=0.15)
    assert side[6:] in text


@pytest.mark.parametrize(
    ("step", "words"), [(-20.0, "dropped suddenly before"), (20.0, "rose suddenly before"), (-0.05, "")]
)
def test_a_change_of_the_stiffness_has_direction_size_and_interval(mill: Any, step: float, words: str) -> None:
    stiffness = (SCATTER if words else 0.01 * SCATTER) + step * (np.arange(24) >= 12)
    found = findings(status(mill, monthly_rows("x", SCATTER, stiffness)))
    assert ("value-changed" in found) is bool(words)
    if words:
        text = found["value-changed"].text
        size, half = map(float, text.partition(", by ")[2].partition(" %")[0].split(" ± "))
        assert words in text
        assert size == pytest.approx(20.0, abs=half)
        assert half == pytest.approx((1 + step / 100) * 2.07 * 0.1 * np.sqrt(2 / 12), rel=0.2)


def test_scatter_that_repeats_states_its_correlation_and_false_alarms() -> None:
    rng, y = np.random.default_rng(1), np.zeros(60)
    for i in range(1, 60):
        y[i] = 0.7 * y[i - 1] + rng.normal(0, 0.1)
    times = [START + timedelta(days=30 * i) for i in range(60)]
    taps = [TapValue(time, 1700 * float(np.exp(p / 100))) for time, p in zip(times, y, strict=True)]
    trend = fit_trend(taps, times[-1])
    (remark,) = (one for one in scatter_remarks("x", trend) if one.code == "scatter-correlated")
    check = trend.scatter_check
    assert check is not None
    assert check.false_alarm_share is not None
    assert f"correlation {check.correlation:.2f}" in remark.text
    assert f"so {100 * check.false_alarm_share:.0f}% of healthy" in remark.text


def test_two_groups_ask_for_the_operator_if_a_single_one_is_missing() -> None:
    rng = np.random.default_rng(3)
    y = rng.normal(0, 0.04, 30) + 0.4 * rng.integers(0, 2, 30)
    times = [START + timedelta(days=30 * i) for i in range(30)]
    for names, words in ((["a"] * 29 + [""], "Record the operator"), (["a"] * 30, "Clamp the tool")):
        values = zip(times, y, names, strict=True)
        taps = [TapValue(time, 1700 * float(np.exp(p / 100)), operator=name) for time, p, name in values]
        (remark,) = scatter_remarks("x", fit_trend(taps, times[-1]))
        assert remark.cure.startswith(words)


@pytest.mark.parametrize(("days", "text"), [(29.9, ""), (30.1, "1 day"), (31.5, "2 days")])
def test_an_overdue_test_counts_begun_days(days: float, text: str) -> None:
    remarks = [*date_remarks("tap", START, 30.0, START + timedelta(days=days), "MACHINE")]
    assert [remark.code for remark in remarks] == (["overdue"] if text else [])
    assert not text or f"{text} " in f"{remarks[0].text} "
