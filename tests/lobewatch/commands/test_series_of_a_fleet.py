"""Conditions of tap tests and data of other machines in the status of a machine."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition import Conditions
from lobewatch.fleet.summarize import learn_scatter, summarize_machine
from lobewatch.monitoring.trend import DAYS_PER_MONTH, Trend

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""
Run = Callable[..., Any]
FREQUENCY = 1713.0


def tap_series(shop: Shop, percents: NDArray[np.float64], first: int = 0, **said: Any) -> None:
    """Monthly tests in both directions, alike but for a little; said: a value a test."""
    for month, percent in enumerate(percents, first):
        about = {name: values[month - first] for name, values in said.items()}
        shop.tap(DAYS_PER_MONTH * month, FREQUENCY * math.exp(percent / 100), **about)


def trend_of(shop: Shop) -> Trend:
    trend = shop.logbook.status().series[0].trend
    assert isinstance(trend, Trend)
    return trend


def test_who_held_the_hammer_counts_in_the_watch(new_shop: type[Shop], tmp_path: Path) -> None:
    y = 0.1 * np.random.default_rng(1).normal(size=24) - np.where(np.arange(24) < 12, 0, 0.25)
    names = ["Kim"] * 12 + ["Bo"] * 12
    unsaid, said = new_shop(tmp_path / "unsaid"), new_shop(tmp_path / "said")
    for shop in (unsaid, said):
        shop.put("")
    tap_series(unsaid, y)
    tap_series(said, y, operator=names)
    assert trend_of(unsaid).open_drop is not None
    assert trend_of(said).open_drop is None
    assert [point.operator for point in trend_of(said).points] == names


def shop_with_hours(shop: Shop, hours: list[float | None]) -> Trend:
    shop.put("")
    use = np.concatenate([[0.0], np.cumsum(np.repeat([100.0, 400.0], [12, 12]))])
    y = -use / 4000 + 0.02 * np.random.default_rng(2).normal(size=25)
    tap_series(shop, y, conditions=[Conditions(hours=spent) for spent in hours])
    return trend_of(shop)


USED: list[float | None] = [0.0, *np.cumsum(np.repeat([100.0, 400.0], [12, 12])).tolist()]


def test_running_hours_are_the_time_of_a_forecast(new_shop: type[Shop], tmp_path: Path) -> None:
    by_hours = shop_with_hours(new_shop(tmp_path / "hours"), USED)
    by_days = shop_with_hours(new_shop(tmp_path / "days"), [None] * 25)
    last = by_hours.points[-1].time.timestamp() / 86400
    truth = last + DAYS_PER_MONTH * (3.0 - 1.5) / 0.1  # 0.1 % a month at 400 h a month
    reached = by_hours.forecast_level(-3.0)
    assert reached.earliest is not None
    assert reached.latest is not None
    assert reached.earliest <= truth <= reached.latest
    assert by_hours.likeliest_shape is not None
    assert by_days.likeliest_shape is not None
    assert by_hours.likeliest_shape.kind == "line"
    assert by_days.likeliest_shape.kind != "line"
    assert by_hours.rate is not None
    assert by_hours.rate.value == pytest.approx(-0.1, abs=0.005)
    assert by_hours.likeliest_shape.start == pytest.approx(by_hours.points[0].time.timestamp() / 86400, abs=1)


def test_hours_that_go_back_are_reported_and_do_not_count(new_shop: type[Shop], tmp_path: Path) -> None:
    wrong = [*USED[:20], USED[2], *USED[21:]]
    back = new_shop(tmp_path / "back")
    by_wrong, by_days = shop_with_hours(back, wrong), shop_with_hours(new_shop(tmp_path / "days"), [None] * 25)
    assert by_wrong.forecast_level(-3.0) == by_days.forecast_level(-3.0)
    remarks = [remark for row in back.logbook.history.rows for remark in row.remarks]
    (text,) = [remark.text for remark in remarks if remark.code == "hours-went-back"]
    assert "200 h" in text
    assert "4000 h" in text


def test_a_spindle_that_stood_still_has_decayed_in_no_time(new_shop: type[Shop], tmp_path: Path) -> None:
    hours: list[float | None] = [0.0, 100.0, 100.0, 100.0, *(100.0 * i for i in range(2, 23))]
    trend = shop_with_hours(new_shop(tmp_path / "m"), hours)
    assert trend.past_fit is not None
    steps = np.diff(trend.past_fit.dates)
    assert np.all(steps > 0)
    assert steps[1:3] == pytest.approx([1e-6, 1e-6])


def test_hours_are_taken_at_the_command_and_listed(run: Run, shop: Shop, tmp_path: Path) -> None:
    beam = Path(__file__).parents[2] / "data" / "ladisk_beam" / "acceleration.lvm"
    said = run("replay", shop.path, beam, "--hours", "1234.5", "--accept", "no-mode-in-band")
    assert said.code in (0, 2), said.err
    (tap,) = json.loads(run("history", shop.path, "--json").out)["taps"]
    assert tap["conditions"]["hours"] == 1234.5
    assert "1234.5 h" in run("history", shop.path).out
    wrong = run("replay", shop.path, beam, "--hours", "-1")
    assert wrong.code == 2
    assert "-1" in wrong.err
    assert "1e+06" in wrong.err


def test_a_young_machine_learns_the_scatter_of_the_others(new_shop: type[Shop], tmp_path: Path) -> None:
    random = np.random.default_rng(3)
    for number in range(5):
        other = new_shop(tmp_path / f"other{number}")
        other.put("")
        tap_series(other, 0.2 * random.normal(size=16))
        summarize_machine(other.logbook, other.start + timedelta(days=600))
    fallen = np.array([0.1, -0.1, 0.05, -1.2, -1.0, -1.1])
    young, alone = new_shop(tmp_path / "young"), new_shop(tmp_path / "far" / "alone")
    for shop in (young, alone):
        shop.put("")
        tap_series(shop, fallen[:1])
        learn_scatter(shop.logbook)
        learn_scatter(shop.logbook)
        tap_series(shop, fallen[1:], 1)
    lines = [json.loads(line) for line in (young.path / "journal.jsonl").read_text("utf-8").splitlines()]
    (line,) = [line for line in lines if line["kind"] == "scatter"]
    assert line["alone"][0] == pytest.approx(0.2, rel=0.4)
    assert line["series"] == 5
    assert trend_of(young).open_drop is not None
    assert trend_of(alone).open_drop is None
    assert "scatter" not in (alone.path / "journal.jsonl").read_text("utf-8")
    before = trend_of(young).detection.scores
    for number in range(5):
        (tmp_path / f"other{number}" / "standing.json").unlink()
    learn_scatter(young.logbook)
    np.testing.assert_array_equal(trend_of(young).detection.scores, before)


def test_after_a_repair_the_scatter_of_before_is_known(run: Run, new_shop: type[Shop], tmp_path: Path) -> None:
    random = np.random.default_rng(5)
    shop = new_shop(tmp_path / "mill")
    shop.put("")
    for week, percent in enumerate(0.2 * random.normal(size=16)):
        for tool in ("reference", "long"):
            shop.tap(7 * week, FREQUENCY * math.exp(percent / 100), tool=tool)
            shop.tap(7 * week + 0.1, 0.98 * FREQUENCY * math.exp(percent / 100), "y", tool=tool)
    repaired = shop.start + timedelta(days=110)
    assert run("event", shop.path, "new bearings", "--date", f"{repaired:%Y-%m-%d}", "--new-baseline").code == 0
    assert shop.logbook.files.fleet_scatter is None
    shop.tap(112, FREQUENCY)
    assert run("event", shop.path, "coolant pump replaced").code == 0  # whatever tells of the machine
    known = shop.logbook.files.fleet_scatter
    assert known is not None
    assert known.series == 4
    assert known.alone[0] == pytest.approx(0.2, rel=0.4)


def test_a_fall_that_has_slowed_down_is_reported_to_settle(new_shop: type[Shop], tmp_path: Path) -> None:
    random = np.random.default_rng(6)
    run_in, worn = new_shop(tmp_path / "run-in"), new_shop(tmp_path / "worn")
    months = np.arange(24.0)
    for shop, fall in ((run_in, -1.0 * (1 - np.exp(-months / 3))), (worn, -0.05 * months)):
        shop.put("")
        tap_series(shop, fall + 0.05 * random.normal(size=24))
    said = [next(r for r in shop.logbook.status().reasons if r.code == "decay").text for shop in (run_in, worn)]
    assert "run-in" in said[0]
    assert "run-in" not in said[1]
