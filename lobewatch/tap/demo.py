"""Tap tests of an aging emulated spindle, compared with its true values."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from datetime import UTC, datetime, timedelta
from typing import NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from acquisition import UNKNOWN_CONDITIONS, Circumstances, Conditions, DataError, Structure, TapDirection
from acquisition.errors import join_sentences
from lobewatch.logbook import Logbook
from lobewatch.logbook.machine_forecast import forecast_machine
from lobewatch.machine import MachineFolder
from lobewatch.machine.folder_updates import add_event
from lobewatch.measurement import Measurement
from lobewatch.monitoring.threshold_dates import ThresholdDates
from lobewatch.monitoring.trend import DAYS_PER_MONTH, Trend, days_since_epoch
from lobewatch.tap.emulated_mass import DEMO_MASS, build_hung_mass, check_emulated_mass
from lobewatch.tap.emulated_spindle import (
    MountingVariation,
    SpindleWear,
    build_structure,
    get_spindle_table,
    open_synchronized_device,
    remount_spindle,
)
from lobewatch.tap.hit_loop import TapPhases
from lobewatch.tap.start_questions import StartQuestions
from lobewatch.tap.state import StatePublisher, TapState, TapStep
from lobewatch.tap.tap_in_progress import begin_tap

TEST_DAY, TEST_HOUR = 15, 9
"""Day of the month, and hour, of the tests of a month."""
DEMO_DIRECTIONS: dict[TapDirection, int] = {"x": 0, "y": 30}
"""Directions of the tests of a month, with the minute of the hour at which each is taken."""


class SpindleState(NamedTuple):
    """Spindle in four numbers."""

    frequency: float
    """First natural frequency (Hz)."""
    damping_ratio: float
    """Damping ratio of that mode (-)."""
    stiffness: float
    """Stiffness of that mode at the tool tip (N/m)."""
    bearing_stiffness: float
    """Stiffness of each bearing (N/m)."""

    def relative_to(self, reference: SpindleState) -> SpindleState:
        """Return the relative differences from a reference (-)."""
        return SpindleState(*(value / base - 1 for value, base in zip(self, reference, strict=True)))


class PlannedTap(NamedTuple):
    """Tap test of the demo before it is taken."""

    date: datetime
    """Date in the simulated calendar; those of the two tests of a month differ."""
    direction: TapDirection
    """Tapped direction."""
    structure: Structure
    """Structure that is hit."""
    truth: SpindleState
    """True values of the emulated spindle."""
    conditions: Conditions = UNKNOWN_CONDITIONS
    """Conditions of the test."""


TakenTap = tuple[PlannedTap, str]
"""Planned test, and the id of the stored tap test."""


class DemoTap(NamedTuple):
    """Tap test of the demo with its result."""

    plan: PlannedTap
    """Planned test with the true values."""
    result: SpindleState
    """Spindle as measured."""


def plan_taps(
    folder: MachineFolder, wear: SpindleWear, random: np.random.Generator, mounting: MountingVariation, now: datetime
) -> list[PlannedTap]:
    """Plan tap tests in x and y every month of a scenario up to now. The tool is reclamped before each test.

    Each test has bearings whose stiffness gives the f1 after reclamping. now: the last two tests are those of its
    month, or of the month before if that day is still to come.
    """
    months, damping_ratio = wear.months, get_spindle_table(folder).damping_ratio
    shifts, warmth = mounting.shifts(months, len(DEMO_DIRECTIONS), random), mounting.temperatures(months)
    last = _find_last_month(now)
    plans = []
    for month in range(months):
        year, index = divmod(last - months + 1 + month, 12)
        spindle = wear.spindle(month)
        under = UNKNOWN_CONDITIONS if warmth is None else Conditions(temperature_c=round(float(warmth[month]), 1))
        for (direction, minute), shift in zip(DEMO_DIRECTIONS.items(), shifts[month].tolist(), strict=True):
            date = datetime(year, index + 1, TEST_DAY, TEST_HOUR, minute, tzinfo=UTC)
            mounted = remount_spindle(spindle, shift)
            structure = build_structure(mounted, damping_ratio)
            truth = structure.frequency[0], damping_ratio, structure.stiffness[0], mounted.bearings[0].stiffness
            plans.append(PlannedTap(date, direction, structure, SpindleState(*map(float, truth)), under))
    return plans


def _find_last_month(now: datetime) -> int:
    """Return the newest month whose tests are past, counted from the year 0."""
    now = now.astimezone(UTC)
    tested = now.replace(day=TEST_DAY, hour=TEST_HOUR, minute=max(DEMO_DIRECTIONS.values()), second=0, microsecond=0)
    return 12 * now.year + now.month - 1 - (now < tested)


def age_spindle(
    folder: MachineFolder, wear: SpindleWear, seed: int, mounting: MountingVariation, *, tcp: bool = False
) -> Iterator[TakenTap]:
    """Check the sensors with a mass, then take the tap tests of `plan_taps`.

    Each test, and the check the day before the first, runs through a real port: a pseudo-terminal, or TCP on loopback.
    """
    random = np.random.default_rng(seed)
    plans = plan_taps(folder, wear, random, mounting, datetime.now(UTC))
    with (
        open_synchronized_device(build_hung_mass(DEMO_MASS), np.random.default_rng(seed), tcp=tcp) as open_device,
        threadpool_limits(limits=1),
    ):
        check_emulated_mass(folder, open_device, plans[0].date - timedelta(days=1))
    for number, (plan, hammering) in enumerate(zip(plans, random.spawn(len(plans)), strict=True)):
        if wear.replaced_at is not None and number == len(DEMO_DIRECTIONS) * wear.replaced_at:
            add_event(folder, "bearings replaced", plan.date - timedelta(days=1), new_baseline=True)
        yield plan, _run_tap(folder, plan, hammering, tcp)


def compare_with_truth(logbook: Logbook, taken: Iterable[TakenTap]) -> list[DemoTap]:
    """Compare the results of these tests with the true values. DataError if one does not show the followed mode.

    The history is computed once, after the last test, and not after every one with a verdict on every program.
    """
    return [DemoTap(plan, _get_measured_state(logbook.measurement(tap_id))) for plan, tap_id in taken]


def _run_tap(folder: MachineFolder, plan: PlannedTap, random: np.random.Generator, tcp: bool) -> str:
    """Take and commit one tap test, as a session without a person does. Return its id."""
    machine, toml = folder.machine, folder.toml_text
    where = machine.machine.name, plan.date, machine.tap.tool, plan.direction
    about = Circumstances(*where, "the demo", toml, conditions=plan.conditions)
    publisher = StatePublisher(TapState(0, TapStep.CHECKING, "", wanted=machine.tap.hits))
    with (
        open_synchronized_device(plan.structure, random, tcp=tcp) as open_device,
        threadpool_limits(limits=1),
        folder.locked(),
    ):
        tap = begin_tap(folder, about, resume=False)
        questions = StartQuestions(publisher, machine.tap.tool, (), asks=False)
        TapPhases(folder, open_device, publisher, questions=questions, guided=False).run(tap)
        folder.commit(tap.finish())
    return tap.id


def _get_measured_state(measurement: Measurement) -> SpindleState:
    mode, calibration = measurement.followed, measurement.calibration
    if mode is None or calibration is None:
        texts = *map(str, measurement.remarks), "Use a smaller MountingVariation.scatter"
        raise DataError(f"tap {measurement.tap_id}: {join_sentences(*texts)}")
    return SpindleState(mode.frequency, mode.damping_ratio, mode.stiffness, calibration.bearing_stiffness)


FORECAST_DROP = 0.02
"""Relative frequency drop from the present value that is forecast, chosen."""


class LevelForecast(NamedTuple):
    """Forecast of one level after the last test."""

    level: str
    """Level in words."""
    reached: ThresholdDates
    """Forecast of when it is reached."""
    truth: float | None
    """Date at which the emulated spindle without scatter is there (days since 1970), None if never."""


def forecast_levels(logbook: Logbook, wear: SpindleWear) -> list[LevelForecast]:
    """Forecast, after the last test, a further drop in x, and each program that will not be stable."""
    last = logbook.history.rows[-1].time
    prospect = forecast_machine(logbook, last)
    x = next((series for series in prospect.status.series if series.direction == "x"), None)
    if x is None or x.trend is None:
        return []
    percent = x.trend.points[-1].percent if x.trend.forecast is None else float(x.trend.forecast.fitted[-1])
    title = f"f1 in x {100 * FORECAST_DROP:g} % lower than now"
    forecasts = [_forecast_level(title, x.trend, percent + 100 * math.log1p(-FORECAST_DROP), wear, last)]
    for name, critical in prospect.critical_drops.items():
        reached = prospect.programs[name].not_stable
        if 0 < critical.not_stable < math.inf and reached.is_known:
            percent = x.trend.points[-1].percent + 100 * math.log1p(-critical.not_stable)
            forecast = _forecast_level(f"{name} not stable", x.trend, percent, wear, last)
            forecasts.append(forecast._replace(reached=reached))
    return forecasts


def _forecast_level(level: str, trend: Trend, percent: float, wear: SpindleWear, last: datetime) -> LevelForecast:
    """Return forecast and true date of a level of a series. percent: 100 ln(f/f_first) there."""
    month = wear.find_month(trend.first_value * math.exp(percent / 100))
    if month is None:
        return LevelForecast(level, trend.forecast_level(percent), None)
    date = last + timedelta(days=DAYS_PER_MONTH * (month - wear.months + 1))
    return LevelForecast(level, trend.forecast_level(percent), days_since_epoch(date))
