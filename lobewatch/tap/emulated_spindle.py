"""The emulated spindle: the model's modes behind an emulated DAQ. Its truth is known."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from acquisition import (
    Bench,
    Channel,
    DataError,
    Driver,
    EmulatorThread,
    HammeredStructure,
    Hammering,
    SensorInput,
    Structure,
    TapsEmulator,
)
from dsm import Spindle, modes_at, static_stiffness
from lobewatch.machine.folder import MachineFolder

MODES = 8
"""Modes integrated; the rest is their static flexibility."""
SAMPLE_RATE = 25600.0
"""Hz."""
CHANNELS = (
    Channel("force", sensitivity=2.25e-3, full_scale=5.0, calibration_date="2026-01-15"),
    Channel("acceleration", sensitivity=1.02e-3, full_scale=5.0, calibration_date="2026-01-15"),
)
"""A 2.2 kN hammer and a 500 g accelerometer on a 16-bit converter."""


@dataclass(frozen=True)
class EmulatedMachine:
    """A device made of software on a spindle made of numbers."""

    device: EmulatorThread
    """Serves while its context lasts."""
    frequency: float
    """The truth: natural frequency of the first mode (Hz) ..."""
    stiffness: float
    """... and its stiffness at the tapped point (N/m)."""


def emulated_structure(spindle: Spindle, damping_ratio: float, position: float = 0.0) -> Structure:
    """What a hammer meets at a position (m from the tool tip): modes and static residual of the model."""
    frequency, stiffness = modes_at(spindle, MODES, position)
    return Structure(
        frequency=frequency,
        damping_ratio=np.full(MODES, damping_ratio),
        stiffness=stiffness,
        residual=1 / static_stiffness(spindle, position) - float(np.sum(1 / stiffness)),
    )


def with_bearing_stiffness(spindle: Spindle, stiffness: float) -> Spindle:
    """The spindle with every bearing at this stiffness (N/m)."""
    return replace(spindle, bearings=[replace(bearing, stiffness=stiffness) for bearing in spindle.bearings])


def emulator(structure: Structure, random: np.random.Generator, *, realtime: bool, tcp: bool = False) -> TapsEmulator:
    """Somebody taps this structure, again and again, on a TAPS/1 device."""
    signal = HammeredStructure(structure, SAMPLE_RATE, random, Hammering())
    return TapsEmulator(signal, CHANNELS, SAMPLE_RATE, realtime=realtime, tcp=tcp)


def emulate_machine(
    folder: MachineFolder, driver: Driver, seed: int = 1, *, realtime: bool = True, tcp: bool = False
) -> EmulatedMachine:
    """Somebody taps the spindle of a machine, again and again, on a device of this kind.

    DataError where machine.toml has no spindle, or lacks the sensors of a device that does not describe them itself.
    """
    if driver.emulate is None:
        raise DataError(f"{driver.title} cannot be emulated; connect one, or emulate another driver")
    structure, random = _structure(folder), np.random.default_rng(seed)
    bench = Bench(
        lambda rate: HammeredStructure(structure, rate, random, Hammering()),
        _inputs(folder, driver),
        SAMPLE_RATE,
        realtime,
        tcp,
    )
    return EmulatedMachine(driver.emulate(bench), float(structure.frequency[0]), float(structure.stiffness[0]))


def _structure(folder: MachineFolder) -> Structure:
    spindle = folder.machine.spindle
    if spindle is None:
        raise DataError(f"{folder.toml}: no model to emulate: add a [spindle] table (or use lobewatch init --example)")
    return emulated_structure(spindle.build(), spindle.damping_ratio, folder.machine.tap.position_mm / 1e3)


def _inputs(folder: MachineFolder, driver: Driver) -> tuple[SensorInput, ...]:
    if driver.sensors is not None:
        return tuple(SensorInput(number, channel) for number, channel in enumerate(CHANNELS))
    inputs = folder.machine.daq.settings.inputs
    if not inputs:
        raise DataError(
            f'{folder.toml}: no sensors to emulate: give driver = "{driver.name}" in [daq] and two [[daq.channel]] '
            "(docs/devices.md shows them)"
        )
    return inputs
