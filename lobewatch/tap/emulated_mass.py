"""Checks of the sensors of emulated devices: the one that an emulator brings, and an emulated mass to hit."""

import math
from collections.abc import Callable, Sequence
from datetime import datetime

import numpy as np

import acquisition
from acquisition import Driver, HammeredStructure, Hammering, SensorInput, Structure
from acquisition.emulation import SignalFunction
from lobewatch.machine.folder import MachineFolder
from lobewatch.tap.emulated_spindle import emulate_device, map_signal_to_inputs
from lobewatch.tap.mass_check import measure_mass, store_mass_result

PENDULUM_FREQUENCY, PENDULUM_DAMPING_RATIO = 1.2, 0.3
"""Natural frequency (Hz) and damping ratio of the hung mass; chosen: threads of 0.17 m, at rest after a second."""
DEMO_MASS = 1.2
"""Mass that the demo hits (kg); chosen."""


def build_hung_mass(mass: float) -> Structure:
    """Build the structure of a rigid mass (kg) on threads: accelerance 1/m above the pendulum frequency."""
    stiffness = np.array([mass * (2 * math.pi * PENDULUM_FREQUENCY) ** 2])
    return Structure(np.array([PENDULUM_FREQUENCY]), np.array([PENDULUM_DAMPING_RATIO]), stiffness)


def emulate_mass(
    folder: MachineFolder, driver: Driver, mass: float, seed: int = 1, **serving: bool
) -> acquisition.EmulatorThread:
    """Emulate a device whose hammer hits a hung mass (kg) with its accelerometer. serving: as of `emulate_device`."""
    if not (math.isfinite(mass) and mass > 0):
        raise ValueError(f"emulate_mass.mass {mass:g} kg is not above 0. Give the total moving mass.")

    def signal_of(inputs: Sequence[SensorInput], rate: float) -> SignalFunction:
        hammered = HammeredStructure(build_hung_mass(mass), rate, np.random.default_rng(seed), Hammering())
        return map_signal_to_inputs(inputs, hammered)

    return emulate_device(folder, driver, signal_of, **serving)


def check_emulated_mass(folder: MachineFolder, open_device: Callable[[], acquisition.Device], date: datetime) -> None:
    """Check the sensors of a device that hits `build_hung_mass(DEMO_MASS)`, and write the result with a date."""
    with folder.locked(), open_device() as device:
        result = measure_mass(folder, device, DEMO_MASS, lambda _: None)
        store_mass_result(folder, device, result, "the demo", date)
