"""Wear scenarios of an emulated spindle: each develops as intended and is recognized by monitoring and forecast."""

from __future__ import annotations

import math
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from dsm import natural_frequencies
from lobewatch.cli import app
from lobewatch.machine.folder import MachineFolder
from lobewatch.monitoring.alarm_estimate import SeriesChange
from lobewatch.monitoring.trend import DAYS_PER_MONTH, TapValue, Trend, days_since_epoch, fit_trend
from lobewatch.show.terminal.option_names import with_option_names
from lobewatch.tap.demo import PlannedTap, forecast_levels, plan_taps
from lobewatch.tap.emulated_spindle import MountingVariation, SpindleWear, WearScenario, build_mounted_spindle

MONTHS = 24
NOW = datetime(2025, 12, 20, tzinfo=UTC)


def planned(
    folder: MachineFolder, story: WearScenario, seed: int = 1, scatter: float = 0.001, **more: Any
) -> list[PlannedTap]:
    """Return the tests in x."""
    wear, mounting = SpindleWear.of(folder, MONTHS, story), MountingVariation(scatter, **more)
    taps = plan_taps(folder, wear, np.random.default_rng(seed), mounting, NOW)
    return [tap for tap in taps if tap.direction == "x"]


def judged(taps: list[PlannedTap]) -> Trend:
    """Return the status that follows from the true frequencies with scatter."""
    warmth = [tap.conditions.specified.get("temperature_c", math.nan) for tap in taps]
    series = [TapValue(tap.date, tap.truth.frequency, 0.01, warm) for tap, warm in zip(taps, warmth, strict=True)]
    return fit_trend(series, taps[-1].date)


def open_fall(trend: Trend) -> SeriesChange:
    assert trend.open_drop is not None
    return trend.open_drop.change


def reached(trend: Trend, percent: float) -> tuple[float, float, float]:
    """Return the months after the last test at which the frequency has dropped by this share more."""
    assert trend.forecast is not None
    last = days_since_epoch(trend.points[-1].time)
    level = float(trend.forecast.fitted[-1]) - percent
    earliest, probable, latest = ((when - last) / DAYS_PER_MONTH for when in trend.forecast.crossing_dates(level))
    return earliest, probable, latest


def test_a_steady_fall_is_an_alarm_and_its_date_is_predicted(folder: MachineFolder) -> None:
    found = judged(planned(folder, WearScenario.STEADY))
    assert open_fall(found).kind == "slope"
    assert found.forecast is not None
    now = found.first_value * math.exp(found.forecast.fitted[-1] / 100)
    true = SpindleWear.of(folder, MONTHS, WearScenario.STEADY).find_month(now * math.exp(-0.02))
    assert true is not None
    assert reached(found, 2.0)[1] == pytest.approx(true - (MONTHS - 1), abs=0.5)


def test_a_step_is_called_one_and_nothing_is_predicted(folder: MachineFolder) -> None:
    found = judged(planned(folder, WearScenario.STEP))
    assert (open_fall(found).kind, open_fall(found).point) == ("step", 12)
    assert open_fall(found).size == pytest.approx(-100 * math.log(0.98), abs=0.15)
    assert reached(found, 2.0)[1:] == (math.inf, math.inf)


def test_an_accelerating_fall_is_predicted_earlier_than_its_mean_rate_says(folder: MachineFolder) -> None:
    found = judged(planned(folder, WearScenario.ACCELERATING))
    assert open_fall(found).kind == "slope"
    assert found.rate is not None
    mean = found.points[-1].percent / (MONTHS - 1)
    assert found.rate.high < 2 * mean < 0
    wear = SpindleWear.of(folder, MONTHS, WearScenario.ACCELERATING)
    true = wear.find_month(wear.frequency(MONTHS - 1) * math.exp(-0.02))
    assert true is not None
    assert reached(found, 2.0)[1] == pytest.approx(true - (MONTHS - 1), abs=0.5)


def test_replaced_bearings_bring_the_frequency_back_and_wear_again(folder: MachineFolder) -> None:
    wear, taps = SpindleWear.of(folder, MONTHS, WearScenario.REPLACED), planned(folder, WearScenario.REPLACED)
    at = wear.replaced_at
    assert at == 15
    before, after = judged(taps[:at]), judged(taps[at:])
    assert after.first_value / before.first_value == pytest.approx(1, abs=0.004)
    assert before.points[-1].percent < -5
    assert after.detection.needs_repeat  # of nine points the last one is the first that is judged


@pytest.mark.parametrize("seed", range(3))
def test_where_nothing_happens_nothing_is_reported(folder: MachineFolder, seed: int) -> None:
    found = judged(planned(folder, WearScenario.NONE, seed))
    assert found.open_drop is None
    assert reached(found, 2.0)[1:] == (math.inf, math.inf)


def test_a_swing_of_the_temperature_is_recorded_and_no_decay(folder: MachineFolder) -> None:
    taps = planned(folder, WearScenario.NONE, scatter=0.0002, temperature_swing=10.0)
    frequencies = np.array([tap.truth.frequency for tap in taps])
    warmth = np.array([tap.conditions.temperature_c for tap in taps], float)
    assert warmth[[0, 6]] == pytest.approx([12.0, 32.0])
    assert np.polyfit(warmth, 100 * np.log(frequencies), 1)[0] == pytest.approx(-0.015, abs=0.003)
    assert judged(taps).open_drop is None


def test_bad_clampings_are_lower_and_as_many_as_asked(folder: MachineFolder) -> None:
    plain, bad = (
        planned(folder, WearScenario.NONE, scatter=0.0),
        planned(folder, WearScenario.NONE, scatter=0.0, bad_share=0.3),
    )
    shifts = np.array([one.truth.frequency / other.truth.frequency - 1 for one, other in zip(bad, plain, strict=True)])
    assert set(np.round(shifts, 6)) == {0.0, -0.02}
    assert 2 <= np.sum(shifts < -0.01) <= 14


def test_an_emulated_month_is_seeded_and_falls_with_the_scenario(folder: MachineFolder) -> None:
    def frequency(month: int, seed: int = 1) -> float:
        spindle = build_mounted_spindle(folder, WearScenario.STEADY, MONTHS, month, MountingVariation(0.001), seed)
        return float(natural_frequencies(spindle, 1)[0])

    assert frequency(5) == frequency(5) != frequency(5, seed=2)
    assert frequency(23) / frequency(0) == pytest.approx(0.9, abs=0.005)


def test_an_emulated_month_has_the_temperature_of_its_season(folder: MachineFolder) -> None:
    wear = SpindleWear.of(folder, MONTHS, WearScenario.STEADY)
    for month, warmth in ((0, -10.0), (2, -5.0), (3, 0.0), (6, 10.0)):
        spindle = build_mounted_spindle(
            folder, WearScenario.STEADY, MONTHS, month, MountingVariation(temperature_swing=10.0), 1
        )
        shift = float(natural_frequencies(spindle, 1)[0]) / wear.frequency(month) - 1
        assert shift == pytest.approx(-1.5e-4 * warmth, abs=2e-6)


def test_the_truth_is_looked_up_by_the_scenario(folder: MachineFolder) -> None:
    wear = SpindleWear.of(folder, MONTHS, WearScenario.STEADY)
    month = wear.find_month(0.88 * wear.frequency(0))
    assert month is not None
    assert wear.frequency(month) == pytest.approx(0.88 * wear.frequency(0), rel=1e-5)
    assert SpindleWear.of(folder, MONTHS, WearScenario.STEP).find_month(0.88 * wear.frequency(0)) is None


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--story", "sudden"], "'sudden'"),
        (["--bad-clampings", "51"], "--bad-clampings 51"),
        (["--temperature", "-1"], "--temperature -1"),
    ],
)
def test_a_scenario_that_cannot_be_is_rejected(folder: MachineFolder, options: list[str], said: str) -> None:
    out = folder.path / "new"
    told = CliRunner().invoke(app, ["demo", "--out", str(out), *options])
    assert told.exit_code != 0
    assert said in with_option_names(f"{told.output}{told.exception}")
    assert not out.exists()


@pytest.mark.long
@pytest.mark.parametrize("story", [*WearScenario])
def test_each_scenario_is_recognised_through_the_whole_chain(folder: MachineFolder, story: WearScenario) -> None:
    out = folder.path.parent / story
    options = ["--taps", "20", "--story", story, "--scatter", "0.1"]
    CliRunner().invoke(app, ["demo", "--out", str(out), *options], catch_exceptions=False)
    from lobewatch.logbook import Logbook

    logbook = Logbook.open(out)
    forecasts = forecast_levels(logbook, SpindleWear.of(MachineFolder(out), 20, story))
    assert forecasts
    assert any(one.truth is None for one in forecasts) == (story in (WearScenario.STEP, WearScenario.NONE))
    standing = logbook.status(logbook.history.rows[-1].time + timedelta(days=1))
    codes = {remark.code for remark in standing.remarks}
    assert ("decay" in codes) == (story not in (WearScenario.NONE, WearScenario.REPLACED))
    drops = [series.trend.open_drop for series in standing.series if series.trend]
    assert any(drop and drop.change.kind == "step" for drop in drops) == (story is WearScenario.STEP)
