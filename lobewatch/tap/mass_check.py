"""Check of hammer and accelerometer with a hung mass, kept in the journal."""

import contextlib
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
from lobewatch.machine.journal.journal import format_command
from lobewatch.machine.journal.mass_checks import MassCheckEntry, SensorChain, find_deciding_check
from lobewatch.tap.device_connection import DeviceConnection
from lobewatch.tap.self_check import find_quiet_part
from lobewatch.tap.state import Check
from lobewatch.tap.trial_hits import TrialHits

MASS_CHECK_BASELINE_SECONDS = 0.5
"""Length of the record before the first hit (s)."""


def measure_mass(folder: MachineFolder, device: Device, mass: float, tell: Callable[[str], None]) -> MassCalibration:
    """Take as many good hits as a tap test on a freely hung mass (kg), and compare force with mass times acceleration.

    tell: called with instructions and the verdict on each hit. DataError if the journal is damaged.
    """
    folder.refuse_damage()
    wanted = folder.machine.tap.hits
    check_device_rate(folder, device)
    tell(
        f"HIT the suspended mass opposite the accelerometer {wanted} times. Let the mass come to rest before each hit."
    )
    good: list[Hit] = []
    device.start()
    baseline = find_quiet_part(DeviceConnection(device).record(device.blocks(), MASS_CHECK_BASELINE_SECONDS))
    for hit in acquisition.capture_hits(device, TrialHits(folder.machine.tap, baseline).trigger):
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
    command = f"{format_command('sensors', folder.path)} check_mass.mass KG"
    return Check("mass check", True, f"not done yet. It takes two minutes, also after the tap test: {command}", True)


def store_mass_result(
    folder: MachineFolder, device: Device, result: MassCalibration, operator: str = "", date: datetime | None = None
) -> MassCheckEntry | None:
    """Write the result of a check with a known mass to the journal.

    Return None, and write nothing, if it says nothing of the sensitivities: the mass is not rigid, or the hits scatter.
    date: of the check, None for now.
    """
    channels = TapInputs.select(device.channels).channels
    chain = SensorChain.of(device.identity, channels)
    if chain is None or abs(result.phase) > MAX_RIGID_PHASE or result.ratio_std > MAX_SENSITIVITY_DEVIATION:
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
