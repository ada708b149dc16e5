"""Check the sensors of a machine: sample rate, known mass, and channel skew."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

from acquisition import (
    Channel,
    DataError,
    Device,
    DeviceError,
    DeviceIdentity,
    Hit,
    MassCalibration,
    MeasuredRate,
    MeasuredSkew,
    Remark,
    SensorDataLocation,
    calibrate_by_mass,
    capture_hits,
    evaluate_hit,
    measure_rate,
    measure_skew,
    rate_remark,
)
from lobewatch.machine.daq_rates import apply_measured_rate, check_device_rate, has_clock
from lobewatch.machine.folder import MachineFolder
from lobewatch.tap.device_connection import LiveSignal, find_sensor_data
from lobewatch.tap.self_check import SENSOR_ERROR_CODES, find_quiet_part, sensor_remarks
from lobewatch.tap.trial_hits import TrialHits

RATE_MEASUREMENT_SECONDS = 5.0
"""Time for which the rate is measured (s)."""


@dataclass(frozen=True)
class SensorList:
    """A device, its channels, and what is wrong with them."""

    identity: DeviceIdentity
    """Model and serial number of the device."""
    channels: tuple[Channel, ...]
    """Channels of the device, a sensor each."""
    nominal_rate: float
    """Sample rate that it names (Hz)."""
    measured_rate: MeasuredRate | None
    """Sample rate against the clock; None where it follows none, or could not be measured."""
    replaces_nominal: bool
    """Whether the measured rate is worked with."""
    remarks: tuple[Remark, ...]
    """Remarks on sensitivities, ranges, dates and rates that are not believed."""

    @property
    def errors(self) -> tuple[Remark, ...]:
        """Remarks on what is to be put right first."""
        return tuple(remark for remark in self.remarks if remark.code in SENSOR_ERROR_CODES)


def list_sensors(folder: MachineFolder, device: Device, tell: Callable[[str], None]) -> SensorList:
    """Look at a connected device; a rate that is right is kept for it. tell: what is being done, for a person."""
    today = datetime.now(UTC).date()
    remarks = sensor_remarks(device.channels, today, folder.machine.daq.calibration_interval_months)
    remarks += _aliasing_remarks(folder.machine.daq.anti_alias, device.sample_rate)
    nominal, measured = device.sample_rate, None
    if has_clock(device):
        tell(f"measuring the rate for {RATE_MEASUREMENT_SECONDS:g} s")
        try:
            measured = measure_rate(device, RATE_MEASUREMENT_SECONDS)
            apply_measured_rate(folder, device, measured)
            remarks += filter(None, [rate_remark(measured)])
        except DeviceError as error:
            remarks.append(Remark("sample-rate-wrong", "", error.text, error.cure))
    replaced = device.sample_rate != nominal
    return SensorList(device.identity, device.channels, nominal, measured, replaced, tuple(remarks))


def _aliasing_remarks(declared: bool | None, rate: float) -> list[Remark]:
    """An FRF does not show what has folded into it; declared: whether a filter keeps that out, None: nobody says."""
    if declared:
        return []
    filter_text = "nobody says that a filter keeps" if declared is None else "no filter keeps"
    text = (
        f"{filter_text} out what lies above {rate / 2:g} Hz, half the sample rate: it folds down and passes for modes"
    )
    cure = "enter [daq] anti_alias = true where the device or an amplifier has one, else choose a higher rate"
    return [Remark("no-anti-alias", "", text, cure)]


MASS_CHECK_BASELINE_SECONDS = 0.5
"""Time that is listened before the first hit (s)."""


@dataclass(frozen=True)
class MassCheck:
    """What a hung mass says, and where to change what is wrong."""

    calibration: MassCalibration
    """Force over mass times acceleration, and what follows from it."""
    place: SensorDataLocation | None
    """Place where the device keeps its sensitivities; None where machine.toml does."""


def check_mass(folder: MachineFolder, port: str, device: Device, mass: float, tell: Callable[[str], None]) -> MassCheck:
    """Take good hits on a freely hung mass (kg) and compare; tell: what to do, and the verdict on each hit."""
    hits = _capture_good_hits(folder, device, tell)
    return MassCheck(calibrate_by_mass(hits, mass), find_sensor_data(folder.machine.daq, port))


def _capture_good_hits(folder: MachineFolder, device: Device, tell: Callable[[str], None]) -> list[Hit]:
    """As many hits without a fault as a tap test takes."""
    wanted = folder.machine.tap.hits
    check_device_rate(folder, device)
    tell(f"HIT the hung mass opposite the accelerometer, {wanted} times; wait until it is still")
    good: list[Hit] = []
    device.start()
    baseline = find_quiet_part(LiveSignal(device).record(device.blocks(), MASS_CHECK_BASELINE_SECONDS))
    for hit in capture_hits(device, TrialHits(folder.machine.tap, baseline).trigger):
        verdict = evaluate_hit(hit)
        if not verdict.flags:
            good.append(hit)
        text = f"✗ {verdict.flags.words.upper()}  {verdict.text}" if verdict.flags else "✓ GOOD"
        tell(f"{len(good):3d} / {wanted}  {text}")
        if len(good) >= wanted:
            break
    device.stop()
    return good


SKEW_RECORDING_SECONDS = 2.0
"""Time for which a common signal is recorded (s)."""


@dataclass(frozen=True)
class SkewCheck:
    """The skew of a device, and where to enter it."""

    measured: MeasuredSkew
    """Skew of channel 1 against channel 0."""
    sample_rate: float
    """Sample rate at which it was measured (Hz)."""
    channel: Channel
    """Channel 1, with the skew that is entered."""
    place: SensorDataLocation | None
    """Place where the device keeps its skews; None where machine.toml does."""


def check_skew(folder: MachineFolder, port: str, device: Device, tell: Callable[[str], None]) -> SkewCheck:
    """Record a signal that is fed to both inputs of a connected device; tell: what to do, for a person."""
    if len(device.channels) != 2:
        raise DataError(
            f"a skew is that of two inputs; the DAQ has {len(device.channels)}: name two in [[daq.channel]]"
        )
    rate = check_device_rate(folder, device)
    tell(f"recording {SKEW_RECORDING_SECONDS:g} s: both inputs joined with a T-piece, noise or taps on them")
    blocks = []
    device.start()
    for block in device.blocks():
        blocks.append(block.codes)
        if sum(codes.shape[1] for codes in blocks) >= SKEW_RECORDING_SECONDS * rate:
            break
    device.stop()
    first, second = np.concatenate(blocks, axis=1)
    place = find_sensor_data(folder.machine.daq, port)
    return SkewCheck(measure_skew(first, second, rate), rate, device.channels[1], place)
