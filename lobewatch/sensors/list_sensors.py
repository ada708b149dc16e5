"""What is plugged in, what is not believed of it, and its sample rate against the clock of this computer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime

from acquisition import Channel, Device, DeviceError, DeviceIdentity, MeasuredRate, Remark, measure_rate, rate_doubt
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.known_devices import has_clock, use_rate
from lobewatch.tap.self_check import WRONG, sensor_doubts

RATE_SECONDS = 5.0
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
        return tuple(remark for remark in self.remarks if remark.code in WRONG)


def list_sensors(folder: MachineFolder, device: Device, tell: Callable[[str], None]) -> SensorList:
    """Look at a connected device; a rate that is right is kept for it. tell: what is being done, for a person."""
    today = datetime.now(UTC).date()
    remarks = sensor_doubts(device.channels, today, folder.machine.daq.calibration_interval_months)
    remarks += _about_aliasing(folder.machine.daq.anti_alias, device.sample_rate)
    nominal, measured = device.sample_rate, None
    if has_clock(device):
        tell(f"measuring the rate for {RATE_SECONDS:g} s")
        try:
            measured = measure_rate(device, RATE_SECONDS)
            use_rate(folder, device, measured)
            remarks += filter(None, [rate_doubt(measured)])
        except DeviceError as error:
            remarks.append(Remark("sample-rate-wrong", "", error.text, error.cure))
    replaced = device.sample_rate != nominal
    return SensorList(device.identity, device.channels, nominal, measured, replaced, tuple(remarks))


def _about_aliasing(declared: bool | None, rate: float) -> list[Remark]:
    """An FRF does not show what has folded into it; declared: whether a filter keeps that out, None: nobody says."""
    if declared:
        return []
    filter_text = "nobody says that a filter keeps" if declared is None else "no filter keeps"
    text = (
        f"{filter_text} out what lies above {rate / 2:g} Hz, half the sample rate: it folds down and passes for modes"
    )
    cure = "enter [daq] anti_alias = true where the device or an amplifier has one, else choose a higher rate"
    return [Remark("no-anti-alias", "", text, cure)]
