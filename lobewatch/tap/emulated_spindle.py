"""Emulated DAQ on a spindle whose modes, from the spindle model, are known."""

import math
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from typing import Literal, NamedTuple

import numpy as np

import acquisition
from acquisition import CROSS_TAP, Driver, HammeredStructure, SensorInput, Structure, TapDirection, TapsEmulator
from acquisition.emulation import SignalFunction
from dsm import Spindle, modes_at, static_stiffness
from lobewatch.arrays import Floats
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.settings.spindle_tables import SpindleTable

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
        raise ValueError(f"rotate_structure.degrees {degrees:g}: is not an angle of 0 to 90 degrees")
    c, s = round(math.cos(math.radians(degrees)), 12), round(math.sin(math.radians(degrees)), 12)
    shares = {"x": (c * c, s * s), "y": (s * s, c * c), "xy": (c * s, -c * s)}[direction]
    if not any(shares):
        text = "modes along x and y show nothing across; give another angle"
        raise ValueError(f"rotate_structure.degrees {degrees:g} rotate_structure.direction xy: {text}")
    stiffer = 1.0, (1 + SECOND_AXIS_FREQUENCY_SHIFT) ** 2
    visible = [(share, stiff) for share, stiff in zip(shares, stiffer, strict=True) if share]
    frequency = np.concatenate([spindle.frequency * math.sqrt(stiff) for _, stiff in visible])
    stiffness = np.concatenate([spindle.stiffness * stiff / share for share, stiff in visible])
    residual = sum(spindle.residual * share / stiff for share, stiff in visible)
    return Structure(frequency, np.tile(spindle.damping_ratio, len(visible)), stiffness, residual)


def set_bearing_stiffness(spindle: Spindle, stiffness: float) -> Spindle:
    """Return the spindle with this stiffness of every bearing (N/m)."""
    return replace(spindle, bearings=[replace(bearing, stiffness=stiffness) for bearing in spindle.bearings])


def make_emulator(
    structure: Structure, random: np.random.Generator, *, realtime: bool, tcp: bool = False
) -> TapsEmulator:
    """Make a TAPS/1 device on a structure that is tapped again and again."""
    signal = HammeredStructure(structure, EMULATED_SAMPLE_RATE, random)
    return TapsEmulator(signal, EMULATED_CHANNELS, EMULATED_SAMPLE_RATE, realtime=realtime, tcp=tcp)


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

    with TapsEmulator(signal, EMULATED_CHANNELS, EMULATED_SAMPLE_RATE, realtime=False, tcp=tcp) as device:
        yield lambda: _SynchronizedSource(device.port, requested)


class _SynchronizedSource(acquisition.TapsSource):
    """Source that requests a block when the previous one is processed. Its frames are longer than usual."""

    _frame_time = 0.06

    def __init__(self, port: str, requested: threading.Semaphore) -> None:
        super().__init__(port)
        self._wanted = requested

    def blocks(self) -> Iterator[acquisition.Block]:
        for block in super().blocks():
            yield block
            self._wanted.release()

    def close(self) -> None:
        self._wanted.release()
        super().close()


def emulate_machine(
    folder: MachineFolder,
    driver: Driver,
    seed: int = 1,
    *,
    spindle: Spindle | None = None,
    direction: TapDirection = "x",
    axes_angle: float | None = None,
    **serving: bool,
) -> EmulatedMachine:
    """Emulate a device of this kind on the spindle of a machine that is tapped again and again.

    spindle: replaces that of machine.toml, with the same damping. axes_angle: angle from x (deg) of its principal
    directions as in `rotate_structure`, None for a round spindle, the same in x and y. serving: as of `emulate_device`.
    DataError if machine.toml has no spindle, or lacks the sensors of a device that does not describe them itself.
    """
    table, random = get_spindle_table(folder), np.random.default_rng(seed)
    built = build_structure(spindle or table.build(), table.damping_ratio, folder.machine.tap.position_mm / 1e3)
    structure = _select_direction(built, axes_angle, direction)

    def signal_of(inputs: Sequence[SensorInput], rate: float) -> SignalFunction:
        is_crossed = any(_is_cross_sensor(sensor, direction) for sensor in inputs)
        cross = [_select_cross_direction(built, axes_angle, direction)] if is_crossed else []
        hammered = HammeredStructure(structure, rate, random, cross_structures=cross)
        return map_signal_to_inputs(inputs, hammered, direction)

    device = emulate_device(folder, driver, signal_of, **serving)
    return EmulatedMachine(device, float(structure.frequency[0]), float(structure.stiffness[0]))


InputsSignal = Callable[[Sequence[SensorInput], float], SignalFunction]


def emulate_device(
    folder: MachineFolder, driver: Driver, signal_of: InputsSignal, **serving: bool
) -> acquisition.EmulatorThread:
    """Make an emulated device of this kind.

    signal_of: function of its sensors and sample rate (Hz). serving: `realtime` and `tcp` of `EmulationSetup`.
    DataError if such a device cannot be emulated, or machine.toml lacks its sensors.
    """
    if driver.emulate is None:
        raise acquisition.DataError(f"{driver.title} cannot be emulated; connect one, or emulate another driver")
    inputs = get_emulated_inputs(folder, driver)
    signal_at, clock = partial(signal_of, inputs), folder.machine.daq.digital_clock
    setup = acquisition.EmulationSetup(signal_at, inputs, EMULATED_SAMPLE_RATE, digital_clock=clock, **serving)
    return driver.emulate(setup)


def get_spindle_table(folder: MachineFolder, purpose: str = "emulate") -> SpindleTable:
    """Return [spindle] of machine.toml. DataError if there is none."""
    if folder.machine.spindle is None:
        cure = "add a [spindle] table (or use folder_files.make_machine_folder.template)"
        raise acquisition.DataError(f"{folder.toml}: no model to {purpose}: {cure}")
    return folder.machine.spindle


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
        cure = f'give driver = "{driver.name}" in [daq] and two [[daq.channel]] (docs/devices.md shows them)'
        raise acquisition.DataError(f"{folder.toml}: no sensors to emulate: {cure}")
    return inputs
