"""Tap tests of an aging emulated spindle, compared with the truth."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Iterator
from dataclasses import astuple, dataclass
from datetime import UTC, datetime, timedelta
from typing import NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from acquisition import UNKNOWN_CONDITIONS, Circumstances, Conditions, DataError, Structure, TapDirection
from dsm import Spindle
from lobewatch.logbook import Logbook
from lobewatch.logbook.machine_forecast import forecast_machine
from lobewatch.machine import MachineFolder
from lobewatch.machine.folder_updates import add_event
from lobewatch.measurement import Measurement
from lobewatch.monitoring.threshold_dates import ThresholdDates
from lobewatch.monitoring.trend import DAYS_PER_MONTH, Trend, days_since_epoch
from lobewatch.tap.emulated_spindle import build_structure, open_synchronized_device
from lobewatch.tap.hit_loop import OperatorRequests, TapPhases
from lobewatch.tap.state import StatePublisher, TapState, TapStep
from lobewatch.tap.tap_in_progress import begin_tap
from lobewatch.tap.wear_scenarios import MountingVariation, SpindleWear, WearScenario, remount_spindle

SCATTER_ONLY = MountingVariation()
"""Variation of tests that differ by their scatter only."""
TEST_DAY, TEST_HOUR = 15, 9
"""Day of the month, and hour, of the tests of a month."""
DEMO_DIRECTIONS: dict[TapDirection, int] = {"x": 0, "y": 30}
"""Directions of the tests of a month, with the minute of the hour at which each is taken."""


@dataclass(frozen=True)
class SpindleState:
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
        return SpindleState(*(value / base - 1 for value, base in zip(astuple(self), astuple(reference), strict=True)))


@dataclass(frozen=True)
class PlannedTap:
    """Tap test of the demo before it is taken."""

    date: datetime
    """Date in the simulated calendar; those of the two tests of a month differ."""
    direction: TapDirection
    """Tapped direction."""
    structure: Structure
    """Structure that is hit."""
    truth: SpindleState
    """Truth: the spindle as emulated."""
    conditions: Conditions = UNKNOWN_CONDITIONS
    """Conditions of the test."""


@dataclass(frozen=True)
class TakenTap:
    """Committed tap test of the demo."""

    plan: PlannedTap
    """Test as planned, with its truth."""
    id: str
    """Id in the journal."""


@dataclass(frozen=True)
class DemoTap:
    """Tap test of the demo with its result."""

    plan: PlannedTap
    """Test as planned, with its truth."""
    result: SpindleState
    """Spindle as measured."""


def plan_taps(
    folder: MachineFolder,
    months: int,
    random: np.random.Generator,
    scatter: float,
    story: WearScenario = WearScenario.STEADY,
    mounting: MountingVariation = SCATTER_ONLY,
    now: datetime | None = None,
) -> list[PlannedTap]:
    """Plan tap tests in x and y every month of a scenario up to now. The tool is reclamped before each test.

    scatter: relative standard deviation of f1 from test to test (-), replaces that of `mounting`. Each test has
    bearings whose stiffness gives the f1 after reclamping. now: the last two tests are those of its month, or of the
    month before if that day is still to come, None for the clock's. DataError without [spindle].
    """
    wear, mounting = SpindleWear.of(folder, months, story), mounting._replace(scatter=scatter)
    shifts, warmth = mounting.shifts(months, len(DEMO_DIRECTIONS), random), mounting.temperatures(months)
    last = _find_last_month(now or datetime.now(UTC))
    plans = []
    for month in range(months):
        year, index = divmod(last - months + 1 + month, 12)
        spindle = wear.spindle(month)
        under = UNKNOWN_CONDITIONS if warmth is None else Conditions(temperature_c=round(float(warmth[month]), 1))
        for (direction, minute), shift in zip(DEMO_DIRECTIONS.items(), shifts[month].tolist(), strict=True):
            date = datetime(year, index + 1, TEST_DAY, TEST_HOUR, minute, tzinfo=UTC)
            plans.append(_plan_tap(folder, date, direction, remount_spindle(spindle, shift), under))
    return plans


def _find_last_month(now: datetime) -> int:
    """Return the newest month whose tests are past, counted from the year 0."""
    now = now.astimezone(UTC)
    tested = now.replace(day=TEST_DAY, hour=TEST_HOUR, minute=max(DEMO_DIRECTIONS.values()), second=0, microsecond=0)
    return 12 * now.year + now.month - 1 - (now < tested)


def age_spindle(
    folder: MachineFolder,
    months: int,
    seed: int,
    scatter: float,
    story: WearScenario = WearScenario.STEADY,
    mounting: MountingVariation = SCATTER_ONLY,
    *,
    tcp: bool = False,
) -> Iterator[TakenTap]:
    """Take the tap tests of `plan_taps`, each through a real port: a pseudo-terminal, or TCP on loopback."""
    random = np.random.default_rng(seed)
    plans = plan_taps(folder, months, random, scatter, story, mounting)
    replaced = SpindleWear.of(folder, months, story).replaced_at
    for number, (plan, hammering) in enumerate(zip(plans, random.spawn(len(plans)), strict=True)):
        if replaced is not None and number == len(DEMO_DIRECTIONS) * replaced:
            add_event(folder, "bearings replaced", plan.date - timedelta(days=1), new_baseline=True)
        yield TakenTap(plan, _run_tap(folder, plan, hammering, tcp))


def compare_with_truth(logbook: Logbook, taken: Iterable[TakenTap]) -> list[DemoTap]:
    """Compare the results of these tests with the truth. DataError if one does not show the followed mode.

    The history is computed once, after the last test, and not after every one with a verdict on every program.
    """
    return [DemoTap(tap.plan, _get_measured_state(logbook.measurement(tap.id))) for tap in taken]


def _plan_tap(
    folder: MachineFolder, date: datetime, direction: TapDirection, spindle: Spindle, under: Conditions
) -> PlannedTap:
    damping = folder.machine.spindle.damping_ratio if folder.machine.spindle else 0.0
    structure = build_structure(spindle, damping)
    truth = (structure.frequency[0], damping, structure.stiffness[0], spindle.bearings[0].stiffness)
    return PlannedTap(date, direction, structure, SpindleState(*map(float, truth)), under)


def _run_tap(folder: MachineFolder, plan: PlannedTap, random: np.random.Generator, tcp: bool) -> str:
    """Take and commit one tap test, as a session without a person does. Return its id."""
    machine, toml = folder.machine, folder.toml_text
    where = machine.machine.name, plan.date, machine.tap.tool, plan.direction
    about = Circumstances(*where, "the demo", toml, conditions=plan.conditions)
    publisher = StatePublisher(TapState(0, TapStep.CHECKING, "", wanted=machine.tap.hits), time.monotonic)
    with (
        open_synchronized_device(plan.structure, random, tcp=tcp) as open_device,
        threadpool_limits(limits=1),
        folder.locked(),
    ):
        tap = begin_tap(folder, about, resume=False)
        TapPhases(tap, open_device, publisher, OperatorRequests(), guided=False).run()
        folder.commit(tap.finish())
    return tap.id


def _get_measured_state(measurement: Measurement) -> SpindleState:
    mode, calibration = measurement.followed, measurement.calibration
    if mode is None or calibration is None:
        why = "; ".join(map(str, measurement.remarks))
        raise DataError(f"tap {measurement.tap_id}: {why}; take a smaller MountingVariation.scatter")
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
    title = f"f_1 in x {100 * FORECAST_DROP:g} % lower than now"
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
