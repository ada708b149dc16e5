"""A spindle that ages, tapped every month: what was emulated beside what was found."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from dataclasses import astuple, dataclass
from datetime import UTC, datetime

import numpy as np
from threadpoolctl import threadpool_limits

from acquisition import Circumstances, DataError, Structure, TapDirection
from dsm import Spindle, calibrate, natural_frequencies
from lobewatch.analysis import Logbook, Measurement
from lobewatch.machine import MachineFolder
from lobewatch.tap.connection import Connector
from lobewatch.tap.emulated_spindle import device_in_step, emulated_structure, with_bearing_stiffness
from lobewatch.tap.hit_loop import HitLoop, Wishes
from lobewatch.tap.in_progress import begin_tap
from lobewatch.tap.judged_hits import JudgedHits
from lobewatch.tap.phases import Phases
from lobewatch.tap.publisher import Publisher
from lobewatch.tap.state import TapState, Word

FALL = 0.10
"""Fall of the first natural frequency over the demo."""
DIRECTIONS: dict[TapDirection, int] = {"x": 0, "y": 30}
"""Of the tests of a month, and the minute of the hour at which each is taken."""


@dataclass(frozen=True)
class SpindleState:
    """A spindle in four figures."""

    frequency: float
    """First natural frequency (Hz)."""
    damping_ratio: float
    """Its damping ratio (-)."""
    stiffness: float
    """Its stiffness at the tool tip (N/m)."""
    bearing_stiffness: float
    """Of each bearing (N/m)."""

    def relative_to(self, other: SpindleState) -> SpindleState:
        """Relative differences (-)."""
        return SpindleState(*(mine / its - 1 for mine, its in zip(astuple(self), astuple(other), strict=True)))


@dataclass(frozen=True)
class PlannedTap:
    """One tap test of the demo before it is taken."""

    date: datetime
    """Of the simulated calendar; the two of a month differ."""
    direction: TapDirection
    """In which is tapped."""
    structure: Structure
    """What the hammer meets."""
    truth: SpindleState
    """The same in four figures."""


@dataclass(frozen=True)
class TakenTap:
    """One tap test of the demo, committed."""

    plan: PlannedTap
    """What was emulated."""
    id: str
    """In the journal."""


@dataclass(frozen=True)
class DemoTap:
    """One tap test of the demo."""

    plan: PlannedTap
    """What was emulated."""
    found: SpindleState
    """What the pipeline made of the hits."""


def plan_taps(folder: MachineFolder, months: int, random: np.random.Generator, scatter: float) -> list[PlannedTap]:
    """Tap tests in x and y every month, while all bearings lose stiffness; the tool is remounted before each test.

    scatter: standard deviation of f_1 from test to test, as a share of it (-): every test has bearings whose stiffness
    puts f_1 where remounting has moved it. DataError where machine.toml has no spindle.
    """
    worn, plans = _worn(folder, months), []
    for (month, spindle), shifts in zip(enumerate(worn), random.normal(scale=scatter, size=(months, 2)), strict=True):
        frequency = float(natural_frequencies(spindle, 1)[0])
        for (direction, minute), shift in zip(DIRECTIONS.items(), shifts, strict=True):
            date = datetime(2024 + month // 12, month % 12 + 1, 15, 9, minute, tzinfo=UTC)
            remounted = calibrate(spindle, (1 + shift) * frequency).spindle
            plans.append(_plan(folder, date, direction, remounted))
    return plans


def age_spindle(folder: MachineFolder, months: int, seed: int, scatter: float) -> Iterator[TakenTap]:
    """Take the tap tests of `plan_taps`, each through a real serial port (a pseudo-terminal)."""
    random = np.random.default_rng(seed)
    plans = plan_taps(folder, months, random, scatter)
    for plan, hammering in zip(plans, random.spawn(len(plans)), strict=True):
        yield TakenTap(plan, _take(folder, plan, hammering))


def compare_with_truth(logbook: Logbook, taken: Iterable[TakenTap]) -> list[DemoTap]:
    """What all these tests say, beside what was emulated; DataError where one does not show the mode followed.

    The history is worked out once, after the last test, and not anew after every one with a word on every program.
    """
    return [DemoTap(tap.plan, _found(logbook.measurement(tap.id))) for tap in taken]


def _worn(folder: MachineFolder, months: int) -> list[Spindle]:
    """Bearings that lose the same share of their stiffness every month, until f_1 has fallen by FALL."""
    table = folder.machine.spindle
    if table is None:
        raise DataError(f"{folder.toml}: no model to age: add a [spindle] table")
    new = table.build()
    fresh = table.bearing_stiffness_n_per_um * 1e6
    worn = calibrate(new, (1 - FALL) * float(natural_frequencies(new, 1)[0])).bearing_stiffness
    return [with_bearing_stiffness(new, k) for k in np.geomspace(fresh, worn, months)]


def _plan(folder: MachineFolder, date: datetime, direction: TapDirection, spindle: Spindle) -> PlannedTap:
    damping = folder.machine.spindle.damping_ratio if folder.machine.spindle else 0.0
    structure = emulated_structure(spindle, damping)
    truth = (structure.frequency[0], damping, structure.stiffness[0], spindle.bearings[0].stiffness)
    return PlannedTap(date, direction, structure, SpindleState(*map(float, truth)))


def _take(folder: MachineFolder, plan: PlannedTap, random: np.random.Generator) -> str:
    """Take and commit one tap test as a session without a person does; its id."""
    machine, toml = folder.machine, folder.toml.read_text("utf-8")
    about = Circumstances(machine.machine.name, plan.date, machine.tap.tool, plan.direction, "the demo", toml)
    publisher = Publisher(TapState(0, Word.CHECKING, "", wanted=machine.tap.hits), time.monotonic)
    with device_in_step(plan.structure, random) as open_device, threadpool_limits(limits=1), folder.locked():
        hits = JudgedHits(begin_tap(folder, about, resume=False), machine)
        loop = HitLoop(hits, publisher, Wishes(), guided=False)
        Phases(folder, hits, loop, publisher, guided=False).run(Connector(folder, open_device, publisher, time.sleep))
        folder.commit(hits.tap.finish())
    return hits.tap.id


def _found(measurement: Measurement) -> SpindleState:
    mode, calibration = measurement.followed, measurement.calibration
    if mode is None or calibration is None:
        why = "; ".join(map(str, measurement.remarks))
        raise DataError(f"tap {measurement.tap_id}: {why}; take a smaller --scatter")
    return SpindleState(mode.frequency, mode.damping_ratio, mode.stiffness, calibration.bearing_stiffness)
