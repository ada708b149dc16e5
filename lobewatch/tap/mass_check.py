"""Check of hammer and accelerometer with a hung mass, kept in the journal."""

import contextlib
import math
from collections.abc import Callable
from datetime import UTC, datetime

import acquisition
from acquisition import Channel, DataError, Device, DeviceIdentity, Hit, MassCalibration
from acquisition.hit import TapInputs
from acquisition.sensors.mass_calibration import MAX_RIGID_PHASE, MAX_SENSITIVITY_DEVIATION
from acquisition.source import EMULATED_SERIAL
from lobewatch.machine.daq_rates import check_device_rate
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_updates import store_mass_check
from lobewatch.machine.journal.mass_checks import MassCheckEntry, SensorChain, find_deciding_check
from lobewatch.machine.settings.number_text import read_numbers
from lobewatch.measurement.chain_check import format_check_command
from lobewatch.tap.device_connection import DeviceConnection
from lobewatch.tap.self_check import find_quiet_part
from lobewatch.tap.state import Check
from lobewatch.tap.trial_hits import TrialHits

MASS_CHECK_BASELINE_SECONDS = 0.5
"""Length of the record before the first hit (s)."""
MASS_LIMITS = 0.05, 50.0
"""Smallest and largest mass (kg); chosen: an accelerometer with its mount has 0.02 kg, a mass to hang at most 20 kg."""


def read_mass(text: str) -> float:
    """Read a mass (kg) as a person types it; ValueError for no number, and for a mass outside of `MASS_LIMITS`."""
    (mass,) = read_numbers([text.strip()], [MASS_LIMITS])
    return require_mass(mass)


def require_mass(mass: float) -> float:
    """Return a mass (kg); ValueError outside of `MASS_LIMITS`."""
    low, high = MASS_LIMITS
    if not low <= mass <= high:
        cure = "Give the total moving mass, with accelerometer and mount."
        raise ValueError(f"mass={mass} kg is not between {low:g} and {high:g} kg. {cure}")
    return mass


def measure_mass(
    folder: MachineFolder, device: Device, mass: float, tell: Callable[[str], None], direction: str = "x"
) -> MassCalibration:
    """Take as many good hits as a tap test on a freely hung mass (kg), and compare force with mass times acceleration.

    tell: called with instructions and the verdict on each hit. direction: of the accelerometer on the mass, for a DAQ
    with several. DataError if the journal is damaged or the inputs are missing, ValueError for an implausible mass.
    """
    require_mass(mass)
    connection = DeviceConnection(device, direction=direction)
    folder.refuse_damage()
    wanted = folder.machine.tap.hits
    check_device_rate(folder, device)
    sensor = " ".join(["the accelerometer", connection.inputs.channels[-1].direction]).strip()
    tell(f"HIT the suspended mass opposite {sensor} {wanted} times. Let the mass come to rest before each hit.")
    good: list[Hit] = []
    device.start()
    baseline = find_quiet_part(connection.record(device.blocks(), MASS_CHECK_BASELINE_SECONDS))
    for hit in acquisition.capture_hits(device, TrialHits(folder.machine.tap, baseline).trigger, direction):
        verdict = acquisition.evaluate_hit(hit)
        if not verdict.flags:
            good.append(hit)
        text = f"✗ {verdict.flags.words.upper()}  {verdict.text}" if verdict.flags else "✓ GOOD"
        tell(f"{len(good):3d} / {wanted}  {text}")
        if len(good) >= wanted:
            break
    device.stop()
    return acquisition.calibrate_by_mass(good, mass)


def check_mass_entry(folder: MachineFolder, connection: DeviceConnection) -> Check | None:
    """Return the line of the self-check on the mass check of a connected device; None without a force sensor.

    A missing check is offered, but fails nothing: a mass that is hit after the tap test counts as well.
    """
    chain = SensorChain.of(connection.device.identity, connection.inputs.channels)
    if chain is None:
        return None
    found = find_deciding_check(chain, datetime.now(UTC), folder.contents().mass_checks)
    if found is not None:
        result = "passed" if found.passed else "failed"
        text = f"{result} on {found.date.astimezone():%Y-%m-%d}, ratio {found.ratio:.3f}"
        return Check("mass check", found.passed, text)
    command = format_check_command(folder.path, connection.direction, connection.device.channels)
    return Check("mass check", True, f"not done yet. It takes two minutes, also after the tap test: {command}", True)


def store_mass_result(
    folder: MachineFolder, device: Device, result: MassCalibration, operator: str = "", date: datetime | None = None
) -> MassCheckEntry | None:
    """Write the result of a check with a known mass to the journal.

    Return None, and write nothing, if it says nothing of the sensitivities: the mass is not rigid, or the hits scatter.
    date: of the check, None for now.
    """
    chain = SensorChain.of(device.identity, result.channels or ())
    is_rigid = abs(result.phase) <= MAX_RIGID_PHASE and result.ratio_std <= MAX_SENSITIVITY_DEVIATION
    if chain is None or not (is_rigid and math.isfinite(result.ratio)):  # NaN is not rigid
        return None
    numbers = result.mass, result.ratio, result.ratio_std, result.agrees
    return store_mass_check(folder, MassCheckEntry("", date or datetime.now(UTC), *numbers, chain, operator))


def store_emulator_check(folder: MachineFolder, channels: tuple[Channel, ...]) -> None:
    """Write the check that an emulated device brings to the journal: its sensitivities are those of its signals.

    channels: of the device. Only tap tests with these sensitivities count as checked. Nothing is written if the check
    is there already, or the folder cannot be written.
    """
    directions = sorted({channel.direction for channel in channels if channel.quantity == "acceleration"})
    with contextlib.suppress(OSError, DataError):
        for direction in directions:
            selected = TapInputs.select(channels, folder.machine.tap.quantity, direction).channels
            chain = SensorChain.of(DeviceIdentity("emulator", EMULATED_SERIAL), selected)
            now, checks = datetime.now(UTC), folder.contents().mass_checks
            if chain is not None and find_deciding_check(chain, now, checks) is None:
                store_mass_check(folder, MassCheckEntry("", now, None, 1.0, 0.0, True, chain))
