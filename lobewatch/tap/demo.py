"""A spindle that ages, tapped every month: what was emulated beside what was found."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import astuple, dataclass
from datetime import UTC, datetime

import numpy as np

from acquisition import Circumstances, DataError, TapsSource
from dsm import Spindle, calibrate, natural_frequencies
from lobewatch.analysis import Measurement
from lobewatch.machine import MachineFolder
from lobewatch.tap.emulated_spindle import emulated_structure, emulator, with_bearing_stiffness
from lobewatch.tap.session import TapSession

FALL = 0.10
"""Fall of the first natural frequency over the demo."""


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
class DemoTap:
    """One tap test of the demo."""

    date: datetime
    """Of the simulated calendar."""
    truth: SpindleState
    """What was emulated."""
    found: SpindleState
    """What the pipeline made of the hits."""


def age_spindle(folder: MachineFolder, taps: int, seed: int) -> Iterator[DemoTap]:
    """Tap tests a month apart, through a real serial port (a pseudo-terminal), while all bearings lose stiffness."""
    randoms = np.random.default_rng(seed).spawn(taps)
    for date, spindle, random in zip(_dates(), _worn(folder, taps), randoms, strict=False):
        yield _tap(folder, date, spindle, random)


def _dates() -> Iterator[datetime]:
    for month in itertools.count():
        yield datetime(2024 + month // 12, month % 12 + 1, 15, 9, tzinfo=UTC)


def _worn(folder: MachineFolder, taps: int) -> list[Spindle]:
    """Bearings that lose the same share of their stiffness every month, until f_1 has fallen by FALL."""
    table = folder.machine.spindle
    if table is None:
        raise DataError(f"{folder.toml}: no model to age: add a [spindle] table")
    new = table.build()
    fresh = table.bearing_stiffness_n_per_um * 1e6
    worn = calibrate(new, (1 - FALL) * float(natural_frequencies(new, 1)[0])).bearing_stiffness
    return [with_bearing_stiffness(new, k) for k in np.geomspace(fresh, worn, taps)]


def _tap(folder: MachineFolder, date: datetime, spindle: Spindle, random: np.random.Generator) -> DemoTap:
    machine = folder.machine
    damping = machine.spindle.damping_ratio if machine.spindle else 0.0
    structure = emulated_structure(spindle, damping)
    about = Circumstances(machine.machine.name, date, machine.tap.tool, "x", "the demo", folder.toml.read_text("utf-8"))
    with emulator(structure, random, realtime=False) as device:
        session = TapSession(folder, lambda: TapsSource(device.port), about, resume=False, guided=False)
        session.run()
    truth = (structure.frequency[0], damping, structure.stiffness[0], spindle.bearings[0].stiffness)
    return DemoTap(date, SpindleState(*map(float, truth)), _found(session.measurement))


def _found(measurement: Measurement) -> SpindleState:
    mode, calibration = measurement.followed, measurement.calibration
    if mode is None or calibration is None:
        raise DataError(f"tap {measurement.tap_id}: {'; '.join(map(str, measurement.remarks))}")
    return SpindleState(mode.frequency, mode.damping_ratio, mode.stiffness, calibration.bearing_stiffness)
