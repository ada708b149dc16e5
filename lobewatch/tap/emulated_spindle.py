"""Emulate a spindle as it is tapped, and as its bearings wear, it is reclamped and warms up."""

import math
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property
from importlib import resources
from typing import Literal, NamedTuple, Self

import numpy as np

import acquisition
from acquisition import CROSS_TAP, Driver, HammeredStructure, SensorInput, Structure, TapDirection, TapsEmulator
from acquisition.emulation import SignalFunction
from acquisition.errors import join_sentences
from dsm import Spindle, calibrate, modes_at, natural_frequencies, static_stiffness
from lobewatch.arrays import Floats
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.settings.machine_file import parse_machine_file
from lobewatch.machine.settings.spindle_tables import SpindleTable
from lobewatch.monitoring.level_model import STEEL_FREQUENCY_PER_KELVIN
from lobewatch.tap.emulated_faults import NO_FAULTS, EmulatedFaults
from lobewatch.tap.mass_check import store_emulator_check

EMULATED_MODES = 8
"""Number of modes simulated. All higher ones are a static flexibility."""
EMULATED_SAMPLE_RATE = 25600.0
"""Sample rate of the device (Hz)."""
EMULATED_CHANNELS = (
    acquisition.Channel("force", sensitivity=2.25e-3, full_scale=5.0, calibration_date="2026-01-15"),
    acquisition.Channel("acceleration", sensitivity=1.02e-3, full_scale=5.0, calibration_date="2026-01-15"),
)
"""Channels of a 2.2 kN hammer and a 500 g accelerometer on a 16-bit converter."""
SECOND_AXIS_FREQUENCY_SHIFT = 0.05
"""Relative frequency difference along the second principal axis of a spindle with rotated axes."""
RIGID_STIFFNESS = 1e30
"""Modal stiffness of what does not move (N/m)."""
HOST_WAIT_TIME = 0.2
"""Time that a synchronized device waits for its host (s). Then it sends a block anyway."""


class EmulatedMachine(NamedTuple):
    """Emulated device and the true values of its first mode."""

    device: acquisition.EmulatorThread
    """Emulator that serves while its context lasts."""
    frequency: float
    """True natural frequency of the first mode (Hz)."""
    stiffness: float
    """True stiffness of the first mode at the tapped point (N/m)."""


def build_structure(spindle: Spindle, damping_ratio: float, position: float = 0.0) -> Structure:
    """Build the structure at a position (m from the tool tip): modes and static residual of the model."""
    frequency, stiffness = modes_at(spindle, EMULATED_MODES, position)
    residual = 1 / static_stiffness(spindle, position) - float(np.sum(1 / stiffness))
    return Structure(frequency, np.full(EMULATED_MODES, damping_ratio), stiffness, residual)


def rotate_structure(spindle: Structure, degrees: float, direction: TapDirection) -> Structure:
    """Rotate the principal directions of a spindle whose modes are pairs along two perpendicular axes.

    The first axis is `degrees` from x towards y. Along the second, frequencies are higher by
    SECOND_AXIS_FREQUENCY_SHIFT. In a cross FRF, hit in x and measured in y, both show with opposite signs. ValueError
    for an invalid angle, or one that gives no cross FRF.
    """
    if not 0 <= degrees <= 90:
        raise ValueError(f"rotate_structure.degrees {degrees:g} is not between 0 and 90 degrees")
    c, s = round(math.cos(math.radians(degrees)), 12), round(math.sin(math.radians(degrees)), 12)
    shares = {"x": (c * c, s * s), "y": (s * s, c * c), "xy": (c * s, -c * s)}[direction]
    if not any(shares):
        text = f"rotate_structure.degrees {degrees:g} gives no cross FRF for rotate_structure.direction xy"
        raise ValueError(f"{text}. Use an angle above 0 and below 90 degrees.")
    stiffer = 1.0, (1 + SECOND_AXIS_FREQUENCY_SHIFT) ** 2
    visible = [(share, stiff) for share, stiff in zip(shares, stiffer, strict=True) if share]
    frequency = np.concatenate([spindle.frequency * math.sqrt(stiff) for _, stiff in visible])
    stiffness = np.concatenate([spindle.stiffness * stiff / share for share, stiff in visible])
    residual = sum(spindle.residual * share / stiff for share, stiff in visible)
    return Structure(frequency, np.tile(spindle.damping_ratio, len(visible)), stiffness, residual)


def set_bearing_stiffness(spindle: Spindle, stiffness: float) -> Spindle:
    """Return the spindle with this stiffness of every bearing (N/m)."""
    return replace(spindle, bearings=[replace(bearing, stiffness=stiffness) for bearing in spindle.bearings])


@contextmanager
def open_synchronized_device(
    structure: Structure, random: np.random.Generator, *, tcp: bool = False
) -> Iterator[Callable[[], acquisition.TapsSource]]:
    """Serve a tapped structure on a TAPS/1 device that waits for its host. Yields the function that opens it.

    Device and host work in turns: two threads that work at once switch the interpreter at each step, and the reader of
    a port would collect data during the evaluation of a hit, most of which would be discarded.
    """
    hammered, requested = HammeredStructure(structure, EMULATED_SAMPLE_RATE, random), threading.Semaphore()

    def signal(first_scan: int, n_scans: int) -> Floats:
        requested.acquire(timeout=HOST_WAIT_TIME)
        return hammered(first_scan, n_scans)

    class SynchronizedSource(acquisition.TapsSource):
        """Source that requests a block when the previous one is processed. Its frames are longer than usual."""

        _frame_time = 0.06

        def blocks(self) -> Iterator[acquisition.Block]:
            for block in super().blocks():
                yield block
                requested.release()

        def close(self) -> None:
            requested.release()
            super().close()

    with TapsEmulator(signal, EMULATED_CHANNELS, EMULATED_SAMPLE_RATE, realtime=False, tcp=tcp) as device:
        yield lambda: SynchronizedSource(device.port)


def emulate_machine(
    folder: MachineFolder,
    driver: Driver,
    seed: int = 1,
    *,
    spindle: Spindle | None = None,
    direction: TapDirection = "x",
    axes_angle: float | None = None,
    faults: EmulatedFaults = NO_FAULTS,
    **serving: bool,
) -> EmulatedMachine:
    """Emulate a device of this kind on the spindle of a machine that is tapped again and again.

    spindle: replaces that of machine.toml, with the same damping. axes_angle: angle from x (deg) of its principal
    directions as in `rotate_structure`, None for a round spindle, the same in x and y. faults: of the tap test.
    serving: as of `emulate_device`. The check of its sensors is in the journal then.
    DataError if machine.toml lacks the sensors of a device that does not describe them itself.
    """
    table, random = get_spindle_table(folder), np.random.default_rng(seed)
    built = build_structure(spindle or table.build(), table.damping_ratio, folder.machine.tap.position_mm / 1e3)
    structure = _select_direction(built, axes_angle, direction)

    def signal_of(inputs: Sequence[SensorInput], rate: float) -> SignalFunction:
        is_crossed = any(_is_cross_sensor(sensor, direction) for sensor in inputs)
        cross = [_select_cross_direction(built, axes_angle, direction)] if is_crossed else []
        hammered = HammeredStructure(structure, rate, random, faults.hammering, cross_structures=cross)
        return faults.apply(map_signal_to_inputs(inputs, hammered, direction), inputs, rate)

    device = emulate_device(folder, driver, signal_of, clock_error=faults.clock_error, **serving)
    store_emulator_check(folder, tuple(sensor.channel for sensor in get_emulated_inputs(folder, driver)))
    return EmulatedMachine(device, float(structure.frequency[0]), float(structure.stiffness[0]))


InputsSignal = Callable[[Sequence[SensorInput], float], SignalFunction]


def emulate_device(
    folder: MachineFolder, driver: Driver, signal_of: InputsSignal, *, clock_error: float = 0.0, **serving: bool
) -> acquisition.EmulatorThread:
    """Make an emulated device of this kind.

    signal_of: function of its sensors and sample rate (Hz). clock_error: relative error of its clock. serving:
    `realtime` and `tcp` of `EmulationSetup`.
    DataError if such a device cannot be emulated, or machine.toml lacks its sensors.
    """
    if driver.emulate is None:
        raise acquisition.DataError(
            f"{driver.title} cannot be emulated. Connect a real device, or emulate another driver."
        )
    inputs = get_emulated_inputs(folder, driver)

    def signal_at(rate: float) -> SignalFunction:
        return signal_of(inputs, (1 + clock_error) * rate)

    setup = acquisition.EmulationSetup(signal_at, inputs, EMULATED_SAMPLE_RATE, clock_error=clock_error, **serving)
    setup = replace(setup, digital_clock=folder.machine.daq.digital_clock)
    return driver.emulate(setup)


def get_spindle_table(folder: MachineFolder) -> SpindleTable:
    """Return [spindle] of machine.toml, or that of the example machine if there is none."""
    if folder.machine.spindle is not None:
        return folder.machine.spindle
    example = parse_machine_file(resources.files("sim_data").joinpath("surrogate_machine.toml").read_text("utf-8"))
    assert example.spindle is not None
    return example.spindle


def _select_direction(built: Structure, axes_angle: float | None, direction: TapDirection) -> Structure:
    """Return the structure between hammer and sensor in a direction."""
    is_round = axes_angle is None and direction != CROSS_TAP
    return built if is_round else rotate_structure(built, axes_angle or 0.0, direction)


def _select_cross_direction(built: Structure, axes_angle: float | None, direction: TapDirection) -> Structure:
    """Return the structure between hammer and a perpendicular sensor: rigid without rotated axes."""
    if direction == CROSS_TAP:
        return _select_direction(built, axes_angle, "x")
    if axes_angle is None or not 0 < axes_angle < 90:
        return replace(built, stiffness=np.full(built.stiffness.shape, RIGID_STIFFNESS), residual=0.0)
    return _select_direction(built, axes_angle, CROSS_TAP)


def map_signal_to_inputs(
    inputs: Sequence[SensorInput], signal: SignalFunction, direction: TapDirection | Literal[""] = ""
) -> SignalFunction:
    """Return the signal function of these inputs, one row each, from one of force and acceleration.

    direction: of a tap whose signal has the cross acceleration as third row.
    """
    kinds = ("force", "acceleration")
    rows = [kinds.index(sensor.channel.quantity) + _is_cross_sensor(sensor, direction) for sensor in inputs]
    return lambda first_scan, n_scans: signal(first_scan, n_scans)[rows]


def _is_cross_sensor(sensor: SensorInput, direction: str) -> bool:
    """Return whether a sensor is perpendicular to that of the tapped direction."""
    return bool(direction and sensor.channel.direction and sensor.channel.direction != direction[-1])


def get_emulated_inputs(folder: MachineFolder, driver: Driver) -> tuple[SensorInput, ...]:
    """Return the sensors of an emulated device. DataError if machine.toml lacks those it does not describe."""
    if driver.sensor_data is not None:
        channels = EMULATED_CHANNELS[1:] if folder.machine.tap.hammer == "none" else EMULATED_CHANNELS
        return tuple(SensorInput(number, channel) for number, channel in enumerate(channels))
    inputs = folder.machine.daq.settings.inputs
    if not inputs:
        cure = f'Set driver = "{driver.name}" in [daq] and add two [[daq.channel]] tables (docs/devices.md)'
        raise acquisition.DataError(join_sentences(f"{folder.toml}: there are no sensors to emulate", cure))
    return inputs


SCENARIO_DROP = 0.10
"""Relative drop of f1 over a scenario that wears the spindle out, chosen."""
STEP_DROP = 0.02
"""Relative drop of f1 at once, halfway, chosen."""
ACCELERATION_EXPONENT = 3
"""Exponent of time of an accelerating drop, chosen."""
REPLACEMENT_SHARE = 0.6
"""Share of the months after which the bearings are replaced, chosen."""
MAX_SCENARIO_DROP = 0.3
"""Largest relative drop that is computed."""
MAX_FORECAST_MONTHS = 60
"""Months beyond the end of a scenario in which the true date is searched."""
MONTH_BISECTIONS = 20
"""Number of bisections of a month in the search for the date of a drop."""


class WearScenario(StrEnum):
    """Wear scenario of the bearings."""

    STEADY = "steady"
    """f1 drops by the same share every month."""
    STEP = "step"
    """f1 drops at once, halfway, and no more."""
    ACCELERATING = "accelerating"
    """f1 drops faster and faster."""
    REPLACED = "replaced"
    """f1 drops steadily. The bearings are replaced after more than half of the scenario."""
    NONE = "none"
    """f1 does not change."""


@dataclass(frozen=True)
class SpindleWear:
    """Spindle in a wear scenario. Months count from 0, the last test is at `months` - 1."""

    new: Spindle
    """Spindle as built."""
    new_bearing_stiffness: float
    """Stiffness of each bearing when new (N/m)."""
    months: int
    """Length of the scenario (months)."""
    scenario: WearScenario
    """Wear scenario of the bearings."""

    @classmethod
    def of(cls, folder: MachineFolder, months: int, story: WearScenario) -> Self:
        """Return the wear of the spindle of a machine."""
        table = get_spindle_table(folder)
        return cls(table.build(), table.bearing_stiffness_n_per_um * 1e6, months, story)

    @property
    def replaced_at(self) -> int | None:
        """Month before whose tests the bearings are replaced, None if they are not."""
        is_replaced = self.scenario is WearScenario.REPLACED and self.months > 1
        return math.ceil(REPLACEMENT_SHARE * self.months) if is_replaced else None

    def spindle(self, month: float) -> Spindle:
        """Return the spindle in a month."""
        return set_bearing_stiffness(self.new, self.bearing_stiffness(month))

    def frequency(self, month: float) -> float:
        """Return f1 in a month (Hz)."""
        return float(natural_frequencies(self.spindle(month), 1)[0])

    def bearing_stiffness(self, month: float) -> float:
        """Return the stiffness of each bearing in a month (N/m)."""
        if not (drop := self.frequency_drop(month)):
            return self.new_bearing_stiffness
        return float(calibrate(self.new, (1 - drop) * self._first).bearing_stiffness)

    def frequency_drop(self, month: float) -> float:
        """Return the relative drop of f1 since the spindle was new."""
        if self.replaced_at is not None and month >= self.replaced_at:
            month -= self.replaced_at
        share = month / max(self.months - 1, 1)
        falls = {
            WearScenario.STEADY: 1 - (1 - SCENARIO_DROP) ** share,
            WearScenario.REPLACED: 1 - (1 - SCENARIO_DROP) ** share,
            WearScenario.ACCELERATING: SCENARIO_DROP * share**ACCELERATION_EXPONENT,
            WearScenario.STEP: STEP_DROP if month >= self.months / 2 else 0.0,
            WearScenario.NONE: 0.0,
        }
        return float(min(falls[self.scenario], MAX_SCENARIO_DROP))

    @cached_property
    def _first(self) -> float:
        """f1 when new (Hz)."""
        return float(natural_frequencies(set_bearing_stiffness(self.new, self.new_bearing_stiffness), 1)[0])

    def find_month(self, frequency: float) -> float | None:
        """Return the month after the last test in which f1 drops to a frequency (Hz). None if not for years."""
        last = self.months - 1
        months = range(last, last + MAX_FORECAST_MONTHS)
        below = next((month for month in months if self.frequency(month) <= frequency), None)
        if below is None or below == last:
            return below
        low, high = float(below - 1), float(below)
        for _ in range(MONTH_BISECTIONS):
            middle = (low + high) / 2
            low, high = (low, middle) if self.frequency(middle) <= frequency else (middle, high)
        return high


BAD_CLAMPING_DROP = 0.02
"""Relative drop of f1 by a bad clamping, chosen."""
MEAN_SPINDLE_TEMPERATURE = 22.0
"""Yearly mean of the spindle temperature (degC), chosen."""


class MountingVariation(NamedTuple):
    """Variation between tests by reclamping and temperature."""

    scatter: float = 0.0
    """Standard deviation of f1 by reclamping, relative (-)."""
    bad_share: float = 0.0
    """Share of tests with a bad clamping (-)."""
    temperature_swing: float | None = None
    """Half the temperature difference of the spindle between summer and winter (K), None if not recorded."""
    direction_difference: float = 0.0
    """Relative difference of f1 between the tests of a month (-)."""

    def check(self) -> None:
        """Raise ValueError for impossible values."""
        checks = (
            ("scatter", 100 * self.scatter, 5, "%"),
            ("bad_share", 100 * self.bad_share, 50, "%"),
            ("temperature_swing", self.temperature_swing or 0.0, 30, "K"),
        )
        for name, value, most, unit in checks:
            if not 0 <= value <= most:
                raise ValueError(f"MountingVariation.{name} {value:g} is not between 0 and {most} {unit}")

    def temperatures(self, months: int) -> Floats | None:
        """Return the spindle temperature in each month, the first in winter (degC), shape (months,)."""
        if self.temperature_swing is None:
            return None
        season = np.cos(2 * math.pi * np.arange(months) / 12.0)
        return np.asarray(MEAN_SPINDLE_TEMPERATURE - self.temperature_swing * season)

    def shifts(self, months: int, tests: int, random: np.random.Generator) -> Floats:
        """Draw the relative shifts of f1, shape (months, tests)."""
        shifts = random.normal(scale=self.scatter, size=(months, tests)) + self.direction_difference * np.arange(tests)
        if self.bad_share:
            shifts -= BAD_CLAMPING_DROP * (random.random((months, tests)) < self.bad_share)
        if (warmth := self.temperatures(months)) is None:
            return shifts
        return shifts + STEEL_FREQUENCY_PER_KELVIN / 100 * (warmth - MEAN_SPINDLE_TEMPERATURE)[:, np.newaxis]


def remount_spindle(spindle: Spindle, shift: float) -> Spindle:
    """Return the spindle with bearings that shift f1 by this share, as reclamping does."""
    return calibrate(spindle, (1 + shift) * float(natural_frequencies(spindle, 1)[0])).spindle


def build_mounted_spindle(
    folder: MachineFolder, story: WearScenario, months: int, month: int, mounting: MountingVariation, seed: int
) -> Spindle:
    """Build the spindle as mounted in one month of a scenario, the same for the same seed."""
    shifts = mounting.shifts(month + 1, 1, np.random.default_rng([seed, month]))
    return remount_spindle(SpindleWear.of(folder, months, story).spindle(month), float(shifts[month, 0]))
