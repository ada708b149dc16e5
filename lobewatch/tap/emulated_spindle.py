"""The emulated spindle: the model's modes behind an emulated DAQ. Its truth is known."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from acquisition import (
    CROSS_TAP,
    Block,
    Channel,
    DataError,
    Driver,
    EmulationSetup,
    EmulatorThread,
    HammeredStructure,
    Hammering,
    SensorInput,
    Structure,
    TapDirection,
    TapsEmulator,
    TapsSource,
)
from acquisition.emulation import SignalFunction
from dsm import Spindle, modes_at, static_stiffness
from lobewatch.machine.folder import MachineFolder

EMULATED_MODES = 8
"""Number of modes integrated; all higher ones are their static flexibility."""
EMULATED_SAMPLE_RATE = 25600.0
"""Sample rate of the device (Hz)."""
EMULATED_CHANNELS = (
    Channel("force", sensitivity=2.25e-3, full_scale=5.0, calibration_date="2026-01-15"),
    Channel("acceleration", sensitivity=1.02e-3, full_scale=5.0, calibration_date="2026-01-15"),
)
"""A 2.2 kN hammer and a 500 g accelerometer on a 16-bit converter."""
SECOND_AXIS_FREQUENCY_SHIFT = 0.05
"""Relative distance of the frequencies along the second axis of a spindle whose modes lie askew."""
RIGID_STIFFNESS = 1e30
"""Modal stiffness of what does not move (N/m)."""
HOST_WAIT_TIME = 0.2
"""Time that a device in step waits for a host that asks for no more (s); then it sends a block all the same."""


@dataclass(frozen=True)
class EmulatedMachine:
    """A device made of software on a spindle made of numbers."""

    device: EmulatorThread
    """Emulator that serves while its context lasts."""
    frequency: float
    """Natural frequency of the first mode (Hz), the truth."""
    stiffness: float
    """Stiffness of the first mode at the tapped point (N/m), the truth."""


def build_structure(spindle: Spindle, damping_ratio: float, position: float = 0.0) -> Structure:
    """Structure that a hammer meets at a position (m from the tool tip): modes and static residual of the model."""
    frequency, stiffness = modes_at(spindle, EMULATED_MODES, position)
    return Structure(
        frequency=frequency,
        damping_ratio=np.full(EMULATED_MODES, damping_ratio),
        stiffness=stiffness,
        residual=1 / static_stiffness(spindle, position) - float(np.sum(1 / stiffness)),
    )


def rotate_structure(spindle: Structure, degrees: float, direction: TapDirection) -> Structure:
    """Structure that is met in a direction where each mode of a spindle is two, along axes square to each other.

    The first axis lies `degrees` from x, towards y; along the second frequencies are `SECOND_AXIS_FREQUENCY_SHIFT`. Across, of a hit in x
    seen in y, both show with opposite signs. Raises ValueError for an angle that is none, or that shows nothing across.
    """
    if not 0 <= degrees <= 90:
        raise ValueError(f"--askew {degrees:g}: is not an angle of 0 to 90 degrees")
    c, s = round(math.cos(math.radians(degrees)), 12), round(math.sin(math.radians(degrees)), 12)
    shares = {"x": (c * c, s * s), "y": (s * s, c * c), "xy": (c * s, -c * s)}[direction]
    if not any(shares):
        raise ValueError(
            f"--askew {degrees:g} --direction xy: modes along x and y show nothing across; give another angle"
        )
    stiffer = 1.0, (1 + SECOND_AXIS_FREQUENCY_SHIFT) ** 2
    seen = [(share, stiff) for share, stiff in zip(shares, stiffer, strict=True) if share]
    return Structure(
        frequency=np.concatenate([spindle.frequency * math.sqrt(stiff) for _, stiff in seen]),
        damping_ratio=np.tile(spindle.damping_ratio, len(seen)),
        stiffness=np.concatenate([spindle.stiffness * stiff / share for share, stiff in seen]),
        residual=sum(spindle.residual * share / stiff for share, stiff in seen),
    )


def set_bearing_stiffness(spindle: Spindle, stiffness: float) -> Spindle:
    """The spindle with every bearing at this stiffness (N/m)."""
    return replace(spindle, bearings=[replace(bearing, stiffness=stiffness) for bearing in spindle.bearings])


def make_emulator(
    structure: Structure, random: np.random.Generator, *, realtime: bool, tcp: bool = False
) -> TapsEmulator:
    """Somebody taps this structure, again and again, on a TAPS/1 device."""
    signal = HammeredStructure(structure, EMULATED_SAMPLE_RATE, random, Hammering())
    return TapsEmulator(signal, EMULATED_CHANNELS, EMULATED_SAMPLE_RATE, realtime=realtime, tcp=tcp)


@contextmanager
def open_synchronized_device(
    structure: Structure, random: np.random.Generator, *, tcp: bool = False
) -> Iterator[Callable[[], TapsSource]]:
    """Somebody taps this structure on a TAPS/1 device that waits for its host; yields what opens it.

    Device and host work in turns: two threads that work at once hand the interpreter over at each step, and the reader
    of a port takes all that comes while a hit is judged, most of which would be thrown away.
    """
    hammered, wanted = HammeredStructure(structure, EMULATED_SAMPLE_RATE, random, Hammering()), threading.Semaphore()

    def signal(first_scan: int, n_scans: int) -> NDArray[np.float64]:
        wanted.acquire(timeout=HOST_WAIT_TIME)
        return hammered(first_scan, n_scans)

    with TapsEmulator(signal, EMULATED_CHANNELS, EMULATED_SAMPLE_RATE, realtime=False, tcp=tcp) as device:
        yield lambda: _SynchronizedSource(device.port, wanted)


class _SynchronizedSource(TapsSource):
    """Wants another block when the one before is done with; they are longer than where somebody watches."""

    _frame_time = 0.06

    def __init__(self, port: str, wanted: threading.Semaphore) -> None:
        super().__init__(port)
        self._wanted = wanted

    def blocks(self) -> Iterator[Block]:
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
    realtime: bool = True,
    tcp: bool = False,
    spindle: Spindle | None = None,
    direction: TapDirection = "x",
    askew: float | None = None,
) -> EmulatedMachine:
    """Somebody taps the spindle of a machine, again and again, on a device of this kind.

    spindle: in place of that of machine.toml, of the same damping. askew: angle from x (deg) at which its modes lie, as
    `rotate_structure` has it with hammer and sensor in a direction; None: a round spindle, the same in x and y.
    DataError where machine.toml has no spindle, or lacks the sensors of a device that does not describe them itself.
    """
    if driver.emulate is None:
        raise DataError(f"{driver.title} cannot be emulated; connect one, or emulate another driver")
    built, random = _build_tapped_structure(folder, spindle), np.random.default_rng(seed)
    structure = _select_direction(built, askew, direction)
    inputs = get_emulated_inputs(folder, driver)
    beside = (
        [_select_cross_direction(built, askew, direction)]
        if any(_is_cross_sensor(sensor, direction) for sensor in inputs)
        else []
    )
    bench = EmulationSetup(
        lambda rate: map_signal_to_inputs(
            inputs, HammeredStructure(structure, rate, random, Hammering(), beside), direction
        ),
        inputs,
        EMULATED_SAMPLE_RATE,
        realtime,
        tcp,
        folder.machine.daq.digital_clock,
    )
    return EmulatedMachine(driver.emulate(bench), float(structure.frequency[0]), float(structure.stiffness[0]))


def _build_tapped_structure(folder: MachineFolder, replacement: Spindle | None) -> Structure:
    spindle = folder.machine.spindle
    if spindle is None:
        raise DataError(f"{folder.toml}: no model to emulate: add a [spindle] table (or use lobewatch init --example)")
    return build_structure(replacement or spindle.build(), spindle.damping_ratio, folder.machine.tap.position_mm / 1e3)


def _select_direction(built: Structure, askew: float | None, direction: TapDirection) -> Structure:
    """What hammer and sensor meet in a direction."""
    return built if askew is None and direction != CROSS_TAP else rotate_structure(built, askew or 0.0, direction)


def _select_cross_direction(built: Structure, askew: float | None, direction: TapDirection) -> Structure:
    """What a second sensor, square to the first, feels of the same blows: nothing where no mode lies askew."""
    if direction == CROSS_TAP:
        return _select_direction(built, askew, "x")
    if askew is None or not 0 < askew < 90:
        return replace(built, stiffness=np.full(built.stiffness.shape, RIGID_STIFFNESS), residual=0.0)
    return _select_direction(built, askew, CROSS_TAP)


def map_signal_to_inputs(
    inputs: Sequence[SensorInput], signal: SignalFunction, direction: TapDirection | Literal[""] = ""
) -> SignalFunction:
    """A signal of force and acceleration as these sensors feel it, a row each.

    direction: that of a tap whose signal has, as a third row, what is felt square to it.
    """
    kinds = ("force", "acceleration")
    rows = [kinds.index(sensor.channel.quantity) + _is_cross_sensor(sensor, direction) for sensor in inputs]
    return lambda first_scan, n_scans: signal(first_scan, n_scans)[rows]


def _is_cross_sensor(sensor: SensorInput, direction: str) -> bool:
    """Whether a sensor lies square to the one that a tap in a direction is seen by."""
    return bool(direction and sensor.channel.direction and sensor.channel.direction != direction[-1])


def get_emulated_inputs(folder: MachineFolder, driver: Driver) -> tuple[SensorInput, ...]:
    """Sensors on an emulated device; DataError where machine.toml lacks those that the device does not describe."""
    if driver.sensor_data is not None:
        channels = EMULATED_CHANNELS[1:] if folder.machine.tap.hammer == "none" else EMULATED_CHANNELS
        return tuple(SensorInput(number, channel) for number, channel in enumerate(channels))
    inputs = folder.machine.daq.settings.inputs
    if not inputs:
        raise DataError(
            f'{folder.toml}: no sensors to emulate: give driver = "{driver.name}" in [daq] and two [[daq.channel]] '
            "(docs/devices.md shows them)"
        )
    return inputs
