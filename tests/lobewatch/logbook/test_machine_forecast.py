"""When programs stop holding: the fall at which they do, and the date of that fall."""

from __future__ import annotations

import csv
import io
import json
import math
import re
from dataclasses import replace
from datetime import timedelta
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from dsm import calibrate
from lobewatch.cli import app
from lobewatch.history.tap_measurements import NotTappedError
from lobewatch.logbook import Logbook
from lobewatch.logbook.machine_forecast import forecast_machine
from lobewatch.monitoring.threshold_dates import ALREADY_REACHED, NO_FORECAST, ThresholdDates, date_of_days
from lobewatch.monitoring.trend import days_since_epoch
from lobewatch.show.measurement import measurement_json, measurement_texts
from lobewatch.show.report.sections import DATE_HEADS
from lobewatch.show.trend import forecast_date_rows, reach_text
from lobewatch.verdicts import Stability
from lobewatch.verdicts.setting_robustness import find_critical_drop, find_tolerable_drop, model_softening

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""


def run(*arguments: object) -> Result:
    return CliRunner().invoke(app, [*map(str, arguments)], catch_exceptions=False)


def dates(reach: ThresholdDates) -> list[float]:
    """Earliest, probable, latest, and the last day looked at; infinite where none is in sight."""
    days = reach.earliest, reach.probable, reach.latest, reach.forecast_end
    return [math.inf if one is None else one for one in days]


@pytest.fixture
def worn(shop: Shop) -> Shop:
    """One program, two directions that fall by 0.3 % every 15 days, ten times."""
    shop.run(("A", 12900, 1.5))
    for i in range(11):
        shop.tap_both(15 * i, 1 - 0.003 * i + 0.0003 * (-1) ** i)
    return shop


def words_after(shop: Shop, fall: float) -> dict[str, Stability]:
    """Return the verdicts after both directions have dropped by these shares."""
    shop.tap_both(160.0, (1 - 0.03 + 0.0003) * (1 - fall))
    return {one.program.name: one.stability for one in shop.logbook.verdicts()}


def test_a_program_holds_up_to_its_critical_fall_and_not_beyond(worn: Shop) -> None:
    critical = forecast_machine(worn.logbook).critical_drops["A"]
    assert 0.0 <= critical.doubtful < critical.not_stable < 0.1
    assert words_after(worn, critical.not_stable - 0.002)["A"] is Stability.DOUBTFUL
    worn.tap_both(170.0, (1 - 0.03 + 0.0003) * (1 - critical.not_stable - 0.002))
    assert {one.program.name: one.stability for one in worn.logbook.verdicts()}["A"] is Stability.NOT_STABLE


def test_the_date_is_that_of_the_critical_fall_on_the_line(worn: Shop) -> None:
    logbook = worn.logbook
    now = logbook.history.rows[-1].time
    found = forecast_machine(logbook, now)
    fate, (x,) = found.programs["A"], [one for one in found.status.series if one.direction == "x"]
    assert x.trend is not None
    last = x.trend.points[-1]
    a_day = -100 * math.log1p(-0.03) / 150
    expected = last.time + timedelta(days=-100 * math.log1p(-found.critical_drops["A"].not_stable) / a_day)
    earliest, probable, latest, _ = dates(fate.not_stable)
    assert earliest < probable < latest
    assert abs((date_of_days(probable) - expected).days) < 40
    assert dates(fate.doubtful)[1] < probable
    years_of_five_percent = (-100 * math.log1p(-0.05)) / a_day
    assert dates(dict(found.limits)[5.0])[1] - days_since_epoch(worn.start) == pytest.approx(
        years_of_five_percent, rel=0.1
    )


def test_critical_falls_are_computed_once_and_kept(worn: Shop, monkeypatch: pytest.MonkeyPatch) -> None:
    first = forecast_machine(worn.logbook).programs["A"]

    def again(*_: object) -> None:
        raise AssertionError("evaluated again")

    monkeypatch.setattr("lobewatch.logbook.analysis.evaluate_at_speed", again)
    assert forecast_machine(worn.logbook).programs["A"] == first
    worn.edit("depth_mm = 1.5", "depth_mm = 1.4")
    with pytest.raises(AssertionError, match="evaluated again"):
        forecast_machine(worn.logbook)


def test_a_change_of_damping_and_stiffness_is_a_remark(shop: Shop) -> None:
    shop.put("")
    for i in range(14):
        shop.tap(
            15.0 * i,
            1713.0 + (-1) ** i,
            damping_ratio=0.029 * (1 + 0.002 * (-1) ** i) * (1.2 if i > 8 else 1),
            stiffness=3.5e7 * (1 + 0.002 * (-1) ** i) * (0.9 if i > 9 else 1),
        )
    found = shop.logbook.status(shop.logbook.history.rows[-1].time)
    said = [str(remark) for remark in found.remarks if remark.code == "value-changed"]
    assert found.status == "good"
    assert any(re.search(r"damping ratio .*2026-05-30.* 19\.", one) for one in said)
    assert any(re.search(r"stiffness K .*2026-06-14.* 10\.", one) for one in said)
    assert not any("bearing" in one for one in said)


def test_a_short_history_predicts_nothing(shop: Shop) -> None:
    shop.tap_both()
    shop.run(("A", 12900, 1.5))
    found = forecast_machine(shop.logbook)
    assert found.programs["A"].not_stable == NO_FORECAST
    assert found.limits == ((5.0, NO_FORECAST), (10.0, NO_FORECAST))
    told = run("trend", shop.path)
    assert "9 points" in told.stdout
    assert told.stdout.count("8 points") == 1
    assert not any(line.startswith(("A ", "-5 %", "-10 %")) for line in told.stdout.splitlines())


def test_what_predicts_nothing_hides_no_date(worn: Shop) -> None:
    """A tap test of another tool, and a direction that is too young."""
    now = worn.logbook.history.rows[-1].time
    before = forecast_machine(worn.logbook, now)
    assert dates(dict(before.limits)[5.0])[2] < math.inf
    worn.tap(150.5, 1500.0, tool="other")
    after = forecast_machine(worn.logbook, now)
    assert after.limits == before.limits
    assert after.programs == before.programs


def test_a_young_direction_hides_no_date_of_the_other(shop: Shop) -> None:
    shop.run(("A", 12900, 1.5))
    for i in range(11):
        shop.tap(15.0 * i, 1713.0 * (1 - 0.003 * i + 0.0003 * (-1) ** i))
    for i in range(3):
        shop.tap(120.1 + 15.0 * i, 1690.0 * (1 - 0.003 * i), "y")
    found = forecast_machine(shop.logbook, shop.logbook.history.rows[-1].time)
    assert dates(dict(found.limits)[5.0])[2] < math.inf
    assert found.programs["A"].not_stable.latest is not None


def test_overdue_is_reported_as_overdue_and_never_as_measured(worn: Shop) -> None:
    last = worn.logbook.history.rows[-1].time
    found, later = (forecast_machine(worn.logbook, last + timedelta(days=days)) for days in (0, 180))
    assert later.limits == found.limits
    limit = dict(later.limits)[5.0]
    assert not limit.is_measured
    probable = dates(limit)[1]
    assert days_since_epoch(last) < probable < days_since_epoch(last) + 180
    overdue, ahead = reach_text(limit, later.status.time), reach_text(limit, last)
    assert re.findall(r"\d{4}-\d\d-\d\d", overdue) == [f"{date_of_days(probable):%Y-%m-%d}"]
    assert len(re.findall(r"2026-\d\d-\d\d", ahead)) > 1


def test_already_is_what_tap_tests_show(worn: Shop) -> None:
    worn.tap_both(160.0, 0.9)
    found = forecast_machine(worn.logbook, worn.logbook.history.rows[-1].time)
    assert dict(found.limits)[5.0] == ALREADY_REACHED
    assert not re.search(r"\d", reach_text(ALREADY_REACHED, found.status.time))


def test_trend_in_json(worn: Shop) -> None:
    told = run("trend", worn.path, "--direction", "x", "--json")
    found = json.loads(told.stdout)
    assert (found["tool"], found["direction"]) == ("reference", "x")
    assert [one["used"] for one in found["points"]] == [True] * 11
    assert found["points"][10]["percent"] == pytest.approx(100 * np.log((1 - 0.03 + 0.0003) / 1.0003), abs=0.01)
    assert found["score"] > 3.3
    assert found["alarm"]["kind"] == "slope"
    low, high = found["alarm"]["size_interval_percent"]
    assert (low + high) / 2 == pytest.approx(found["alarm"]["size_percent"])
    assert low < 3.0 < high < 4.0
    assert found["light"] == Logbook.open(worn.path).status().status
    assert told.exit_code == int(found["light"] == "alarm") == 1
    rate = found["rate_percent_per_month"]
    assert rate["low"] < rate["value"] < rate["high"] < 0
    assert rate["value"] == pytest.approx(100 * np.log(0.97) / 150 * 30.44, rel=0.05)
    assert set(found["forecast"]) == {"A", "5 %", "10 %"}
    assert set(found["forecast"]["A"]) == {"doubtful", "not stable"}
    assert set(found["forecast"]["5 %"]["reached"]) == {"p10", "p50", "p90"}


def test_trend_as_text_and_csv(worn: Shop) -> None:
    text = run("trend", worn.path).stdout
    lines = text.splitlines()
    assert sum(line.count("o") for line in lines[:12]) >= 9
    assert lines[0].startswith("   +0.0")
    assert all(fact in text for fact in ("2026-01-30", "0.03 %", "-5 %"))
    rows = [*csv.DictReader(io.StringIO(run("trend", worn.path, "--csv").stdout))]
    assert len(rows) == 11
    assert rows[0]["score"] == ""
    assert float(rows[-1]["score"]) > 3.3


@pytest.mark.parametrize(
    ("options", "facts"),
    [
        (["--tool", "other"], "'other'.*SeriesStatus.tool reference SeriesStatus.direction x"),
        (["--direction", "z"], " z.*SeriesStatus.tool reference SeriesStatus.direction x"),
        (["--csv", "--json"], "--csv.*--json"),
    ],
)
def test_what_is_not_there_is_rejected_in_a_sentence(shop: Shop, options: list[str], facts: str) -> None:
    shop.tap(0, 1713.0)
    shop.put("")
    told = CliRunner().invoke(app, ["trend", str(shop.path), *options])
    assert re.search(facts, str(told.exception))


def test_a_machine_that_was_never_tapped_has_no_trend(shop: Shop) -> None:
    told = CliRunner().invoke(app, ["trend", str(shop.path)])
    assert isinstance(told.exception, NotTappedError)


def test_the_report_says_until_when_and_draws_the_line(worn: Shop) -> None:
    assert run("report", worn.path).exit_code == 0
    html = (worn.path / "report.html").read_text("utf-8").replace("\N{NO-BREAK SPACE}", " ")
    assert all(f'<th scope="col">{head}</th>' in html for head in DATE_HEADS)
    assert html.count("2026-01-30</td>") == 2  # since when x and y fall
    assert re.search(r": -5 %.* [\d-]{7,}.*, -10 %.* [\d-]{7,}", html)
    lines = json.loads(html.partition('id="numbers-natural-frequency-2">')[2].partition("<")[0])["lines"]
    assert {line[0] for line in lines} == {"test", "fitted", "forecast"}


def test_a_tool_that_was_never_tapped_holds_as_far_as_is_looked(worn: Shop) -> None:
    worn.run(("shallow", 12900, 0.05), tool="long end mill")
    assert run("report", worn.path).exit_code == 0
    last = f"not before {date_of_days(dates(forecast_machine(worn.logbook).programs['shallow'].doubtful)[3]):%Y-%m}"
    assert f"<td>{last}</td><td>" in (worn.path / "report.html").read_text("utf-8")


def test_a_program_holds_as_far_as_is_looked_beside_a_tool_that_foretells_nothing(worn: Shop) -> None:
    worn.run(("shallow", 12900, 0.05))
    for days in (161.0, 171.0, 181.0):
        worn.tap(days, 1500.0, tool="other")
    found = forecast_machine(worn.logbook)
    last = dates(found.programs["shallow"].doubtful)[3]
    assert date_of_days(last) > worn.logbook.history.rows[-1].time
    told = run("trend", worn.path, "--tool", "other").stdout
    (line,) = [line for line in told.splitlines() if line.startswith("shallow")]
    assert line.count(f"{date_of_days(last):%Y-%m}") == 2


def preload_in_trend(shop: Shop) -> list[float] | None:
    """Return the preload in direction x from `lobewatch trend --json`."""
    found: list[float] | None = json.loads(run("trend", shop.path, "--direction", "x", "--json").stdout)["preload_left"]
    return found


def tap_a_step(shop: Shop) -> list[str]:
    """Drop by 2 % after six of twelve tests that scatter by 0.05 %."""
    shares = np.repeat([1.0, 0.98], 6) + np.tile([5e-4, -5e-4], 6)
    return [shop.tap(30 * i, 1713.0 * share) for i, share in enumerate(shares.tolist())]


def test_trend_and_report_state_the_preload_left(shop: Shop) -> None:
    """The range is that of both laws at both ends of the interval of the drop."""
    tap_a_step(shop)
    model, drop = shop.folder.machine.model("reference"), shop.logbook.status().series[0]
    start = drop.history.frequency.start.value
    ends = [start * (1 - percent / 100) for percent in (0.0, *(drop.drop.interval or ()))]
    new, high, low = (calibrate(model, frequency).bearing_stiffness for frequency in ends)
    left = [(low / new) ** (1 / 0.27), (high / new) ** (1 / 0.32)]
    assert left[0] < 0.6 < 0.66 < left[1] < 2 * left[0]
    assert preload_in_trend(shop) == pytest.approx(left, rel=1e-3)
    percent = f"{100 * left[0]:.2g} to {100 * left[1]:.2g} %"
    assert percent in " ".join(run("trend", shop.path).stdout.split())
    run("report", shop.path)
    page = (shop.path / "report.html").read_text("utf-8").replace("\N{NO-BREAK SPACE}", " ")
    assert f"{100 * left[0]:.2g} to {100 * left[1]:.2g} %" in page


def printed_of(shop: Shop, tap_id: str) -> str:
    """Return the printed text on a tap test."""
    return "\n".join(map(str, measurement_texts(shop.logbook.measurement(tap_id), shop.logbook)))


def test_a_tap_test_compares_preload_with_the_first_one_as_trend_does(shop: Shop) -> None:
    shop.edit("bearing_stiffness_n_per_um = 1280", "bearing_stiffness_n_per_um = 800")
    first, *_, last = tap_a_step(shop)
    assert "preload" not in printed_of(shop, first)
    low, high = preload_in_trend(shop) or (math.nan, math.nan)
    assert high < 1
    assert f"{100 * low:.2g} to {100 * high:.2g} %" in printed_of(shop, last)
    logbook = shop.logbook
    assert measurement_json(logbook.measurement(last), logbook)["preload_left"] == pytest.approx([low, high])
    assert measurement_json(logbook.measurement(first), logbook)["preload_left"] is None


def test_nothing_is_reported_of_preload_where_the_scatter_is_unknown(shop: Shop) -> None:
    shop.tap(0, 1713.0)
    newest = shop.tap(30, 1713.0 * 0.98)
    assert preload_in_trend(shop) is None
    assert "preload" not in printed_of(shop, newest)


def test_nothing_is_reported_of_preload_without_a_proven_change(shop: Shop) -> None:
    shares = 1 + np.tile([5e-4, -5e-4], 5)
    newest = [shop.tap(30 * i, 1713.0 * share) for i, share in enumerate(shares.tolist())][-1]
    assert not shop.logbook.status().series[0].is_change_proven
    assert preload_in_trend(shop) is None
    logbook = shop.logbook
    assert measurement_json(logbook.measurement(newest), logbook)["preload_left"] is None
    assert "preload" not in printed_of(shop, newest)


def test_nothing_is_reported_of_preload_where_the_bearings_are_not_felt(shop: Shop) -> None:
    """They raise f_1 to 2301 Hz at most."""
    shop.tap(0, 2297.0)
    newest = shop.tap(30, 2290.0)
    assert preload_in_trend(shop) is None
    assert "preload" not in printed_of(shop, newest)
    assert "bearings-not-felt" in run("calibrate", shop.path, "--frequency", 2297, "--json").stdout
    assert "preload" not in run("calibrate", shop.path, "--frequency", 2297).stdout


def test_nothing_is_reported_of_the_preload_of_rollers_or_of_a_single_test(shop: Shop) -> None:
    shop.tap(0, 1713.0)
    assert preload_in_trend(shop) is None
    shop.edit("{ position_mm = 617 }", '{ position_mm = 617, rolling_elements = "rollers" }')
    shop.tap(30, 1680.0)
    assert preload_in_trend(shop) is None
    assert "preload" not in run("trend", shop.path).stdout
    run("report", shop.path)
    assert "reload left" not in (shop.path / "report.html").read_text("utf-8")


def test_the_error_of_the_critical_fall_is_its_scatter_over_damping_and_stiffness(shop: Shop) -> None:
    shop.run(("A", 12900, 1.5))
    shop.tap_both()
    (found,) = shop.logbook.verdicts()
    drawn, (stiffness_at, _) = found.samples, model_softening(found.assembly)
    middle, falls = drawn.rows[np.array([0])], []
    for i in range(1, 13):
        one = drawn.rows[np.array([i])]
        rows = replace(middle, damping_ratio=one.damping_ratio, stiffness=one.stiffness)
        falls.append(find_tolerable_drop(replace(drawn, rows=rows), 1.5e-3, stiffness_at))
    assert np.all(np.isfinite(falls))
    assert find_critical_drop(found).error == pytest.approx(np.std(falls), rel=0.3)


def test_a_program_without_a_verdict_is_not_put_down_to_the_history(worn: Shop) -> None:
    worn.run(("A", 12900, 1.5), tool="D99")
    rows = {name: cells for name, *cells in forecast_date_rows(forecast_machine(worn.logbook))}
    assert all("check" in cell for cell in rows["A"])
    (limit,) = (cells for name, cells in rows.items() if "10 %" in name)
    assert re.search(r"\d{4}-\d\d", limit[1])
