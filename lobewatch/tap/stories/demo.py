"""A spindle that ages, tapped every month: the truth beside the result."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from dataclasses import astuple, dataclass
from datetime import UTC, datetime, timedelta

import numpy as np
from threadpoolctl import threadpool_limits

from acquisition import UNSAID, Circumstances, Conditions, DataError, Structure, TapDirection
from dsm import Spindle
from lobewatch.logbook import Logbook
from lobewatch.machine import MachineFolder
from lobewatch.machine.additions.correct import add_event
from lobewatch.measuring import Measurement
from lobewatch.tap.connection import Connector
from lobewatch.tap.emulated_spindle import device_in_step, emulated_structure
from lobewatch.tap.hit_loop import HitLoop, Wishes
from lobewatch.tap.in_progress import begin_tap
from lobewatch.tap.judged_hits import JudgedHits
from lobewatch.tap.phases import Phases
from lobewatch.tap.publisher import Publisher
from lobewatch.tap.state import TapState, TapStep
from lobewatch.tap.stories.mounting import Mounting, remounted
from lobewatch.tap.stories.story import Story, Wear

SCATTERS = Mounting()
"""Tests that differ by their scatter alone."""
DAY, HOUR = 15, 9
"""Day of the month, and hour, of the tests of a month."""
DIRECTIONS: dict[TapDirection, int] = {"x": 0, "y": 30}
"""Directions of the tests of a month, with the minute of the hour at which each is taken."""


@dataclass(frozen=True)
class SpindleState:
    """A spindle in four figures."""

    frequency: float
    """First natural frequency (Hz)."""
    damping_ratio: float
    """Damping ratio of that mode (-)."""
    stiffness: float
    """Stiffness of that mode at the tool tip (N/m)."""
    bearing_stiffness: float
    """Stiffness of each bearing (N/m)."""

    def relative_to(self, reference: SpindleState) -> SpindleState:
        """Relative differences (-)."""
        return SpindleState(*(value / base - 1 for value, base in zip(astuple(self), astuple(reference), strict=True)))


@dataclass(frozen=True)
class PlannedTap:
    """One tap test of the demo before it is taken."""

    date: datetime
    """Date in the simulated calendar; those of the two tests of a month differ."""
    direction: TapDirection
    """Direction in which is tapped."""
    structure: Structure
    """Structure that the hammer meets."""
    truth: SpindleState
    """Truth: the spindle as emulated."""
    conditions: Conditions = UNSAID
    """Conditions of the test."""


@dataclass(frozen=True)
class TakenTap:
    """One tap test of the demo, committed."""

    plan: PlannedTap
    """Test as it was planned, with its truth."""
    id: str
    """Identity in the journal."""


@dataclass(frozen=True)
class DemoTap:
    """One tap test of the demo."""

    plan: PlannedTap
    """Test as it was planned, with its truth."""
    result: SpindleState
    """Spindle as the pipeline measured it."""


def plan_taps(
    folder: MachineFolder,
    months: int,
    random: np.random.Generator,
    scatter: float,
    story: Story = Story.STEADY,
    mounting: Mounting = SCATTERS,
    now: datetime | None = None,
) -> list[PlannedTap]:
    """Tap tests in x and y every month of a story up to now; the tool is remounted before each test.

    scatter: standard deviation of f_1 from test to test, as a share of it (-), in place of that of `mounting`: every
    test has bearings whose stiffness puts f_1 where remounting has moved it. now: the last two are those of its month,
    or of the month before where that day is still to come; None for the clock's. DataError without [spindle].
    """
    wear, mounting = Wear.of(folder, months, story), mounting._replace(scatter=scatter)
    shifts, warmth = mounting.shifts(months, len(DIRECTIONS), random), mounting.temperatures(months)
    last = _last_month(now or datetime.now(UTC))
    plans = []
    for month in range(months):
        year, index = divmod(last - months + 1 + month, 12)
        spindle = wear.spindle(month)
        under = UNSAID if warmth is None else Conditions(temperature_c=round(float(warmth[month]), 1))
        for (direction, minute), shift in zip(DIRECTIONS.items(), shifts[month].tolist(), strict=True):
            date = datetime(year, index + 1, DAY, HOUR, minute, tzinfo=UTC)
            plans.append(_plan(folder, date, direction, remounted(spindle, shift), under))
    return plans


def _last_month(now: datetime) -> int:
    """The newest month whose tests are past, counted from the year 0."""
    now = now.astimezone(UTC)
    tested = now.replace(day=DAY, hour=HOUR, minute=max(DIRECTIONS.values()), second=0, microsecond=0)
    return 12 * now.year + now.month - 1 - (now < tested)


def age_spindle(
    folder: MachineFolder,
    months: int,
    seed: int,
    scatter: float,
    story: Story = Story.STEADY,
    mounting: Mounting = SCATTERS,
    *,
    tcp: bool = False,
) -> Iterator[TakenTap]:
    """Take the tap tests of `plan_taps`, each through a real port: a pseudo-terminal, or TCP on loopback."""
    random = np.random.default_rng(seed)
    plans = plan_taps(folder, months, random, scatter, story, mounting)
    replaced = Wear.of(folder, months, story).replaced_at
    for number, (plan, hammering) in enumerate(zip(plans, random.spawn(len(plans)), strict=True)):
        if replaced is not None and number == len(DIRECTIONS) * replaced:
            add_event(folder, "bearings replaced", plan.date - timedelta(days=1), new_baseline=True)
        yield TakenTap(plan, _take(folder, plan, hammering, tcp))


def compare_with_truth(logbook: Logbook, taken: Iterable[TakenTap]) -> list[DemoTap]:
    """The results of these tests beside what was emulated; DataError where one does not show the mode followed.

    The history is worked out once, after the last test, and not anew after every one with a word on every program.
    """
    return [DemoTap(tap.plan, _result(logbook.measurement(tap.id))) for tap in taken]


def _plan(
    folder: MachineFolder, date: datetime, direction: TapDirection, spindle: Spindle, under: Conditions
) -> PlannedTap:
    damping = folder.machine.spindle.damping_ratio if folder.machine.spindle else 0.0
    structure = emulated_structure(spindle, damping)
    truth = (structure.frequency[0], damping, structure.stiffness[0], spindle.bearings[0].stiffness)
    return PlannedTap(date, direction, structure, SpindleState(*map(float, truth)), under)


def _take(folder: MachineFolder, plan: PlannedTap, random: np.random.Generator, tcp: bool) -> str:
    """Take and commit one tap test as a session without a person does; its id."""
    machine, toml = folder.machine, folder.toml_text
    where = machine.machine.name, plan.date, machine.tap.tool, plan.direction
    about = Circumstances(*where, "the demo", toml, conditions=plan.conditions)
    publisher = Publisher(TapState(0, TapStep.CHECKING, "", wanted=machine.tap.hits), time.monotonic)
    with device_in_step(plan.structure, random, tcp=tcp) as open_device, threadpool_limits(limits=1), folder.locked():
        hits = JudgedHits(begin_tap(folder, about, resume=False), machine)
        loop = HitLoop(hits, publisher, Wishes(), guided=False)
        Phases(folder, hits, loop, publisher, guided=False).run(Connector(folder, open_device, publisher, time.sleep))
        folder.commit(hits.tap.finish())
    return hits.tap.id


def _result(measurement: Measurement) -> SpindleState:
    mode, calibration = measurement.followed, measurement.calibration
    if mode is None or calibration is None:
        why = "; ".join(map(str, measurement.remarks))
        raise DataError(f"tap {measurement.tap_id}: {why}; take a smaller --scatter")
    return SpindleState(mode.frequency, mode.damping_ratio, mode.stiffness, calibration.bearing_stiffness)
