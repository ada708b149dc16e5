"""Check the sensors of a machine: sample rate, known mass, and channel skew."""

from collections.abc import Callable
from typing import NamedTuple

import acquisition
from acquisition import Channel, Device, Remark, SensorDataLocation
from lobewatch.machine.daq_rates import apply_measured_rate, check_device_rate, has_clock
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.journal.mass_checks import MassCheckEntry
from lobewatch.tap.device_connection import collect_codes, find_sensor_data
from lobewatch.tap.mass_check import measure_mass, store_mass_result
from lobewatch.tap.self_check import SENSOR_ERROR_CODES, sensor_remarks

RATE_MEASUREMENT_SECONDS = 5.0
"""Length of the rate measurement (s)."""


class SensorList(NamedTuple):
    """Device, its channels, and remarks on their faults."""

    identity: acquisition.DeviceIdentity
    """Model and serial number of the device."""
    channels: tuple[Channel, ...]
    """Channels of the device, one sensor each."""
    nominal_rate: float
    """Sample rate that the device reports (Hz)."""
    measured_rate: acquisition.MeasuredRate | None
    """Measured sample rate, None if the device has no clock or the measurement failed."""
    replaces_nominal: bool
    """True if the measured rate is used."""
    remarks: tuple[Remark, ...]
    """Remarks on implausible sensitivities, ranges, dates and rates."""

    @property
    def errors(self) -> tuple[Remark, ...]:
        """Remarks on faults that must be corrected first."""
        return tuple(remark for remark in self.remarks if remark.code in SENSOR_ERROR_CODES)


def list_sensors(folder: MachineFolder, device: Device, tell: Callable[[str], None]) -> SensorList:
    """List the sensors of a connected device, check them and measure the sample rate.

    Parameters
    ----------
    folder
        Machine folder, in which an accepted rate is stored.
    device
        Connected device.
    tell
        Function called with a sentence on what is being done.

    Returns
    -------
    SensorList
        Channels, rates and remarks.
    """
    remarks = sensor_remarks(device.channels, folder.machine.daq.calibration_interval_months)
    remarks += _aliasing_remarks(folder.machine.daq.anti_alias, device.sample_rate)
    nominal, measured = device.sample_rate, None
    if has_clock(device):
        tell(f"measuring the sample rate for {RATE_MEASUREMENT_SECONDS:g} s")
        try:
            measured = acquisition.measure_rate(device, RATE_MEASUREMENT_SECONDS)
            apply_measured_rate(folder, device, measured)
            remarks += filter(None, [acquisition.rate_remark(measured)])
        except acquisition.DeviceError as error:
            remarks.append(Remark("sample-rate-wrong", "", error.text, error.cure))
    replaced = device.sample_rate != nominal
    return SensorList(device.identity, device.channels, nominal, measured, replaced, tuple(remarks))


def _aliasing_remarks(declared: bool | None, rate: float) -> list[Remark]:
    """Return the remark on a missing anti-alias filter. declared: whether there is one, None if not stated."""
    if declared:
        return []
    stated = "no anti-alias filter is stated" if declared is None else "the device has no anti-alias filter"
    text = f"{stated}, so vibration above {rate / 2:g} Hz (half the sample rate) may appear as false modes"
    cure = "If the device or an amplifier has a filter, set [daq] anti_alias = true. Otherwise use a higher sample rate"
    return [Remark("no-anti-alias", "", text, cure)]


class MassCheck(NamedTuple):
    """Result of the check with a hung mass, and where to correct a sensitivity."""

    calibration: acquisition.MassCalibration
    """Ratio of force to mass times acceleration, and conclusions."""
    place: SensorDataLocation | None
    """Location of the sensitivities in the device, None if machine.toml has them."""
    entry: MassCheckEntry | None = None
    """Line in the journal, None if the result says nothing of the sensitivities."""


def check_mass(
    folder: MachineFolder,
    port: str,
    device: Device,
    mass: float,
    tell: Callable[[str], None],
    operator: str = "",
    direction: str = "x",
) -> MassCheck:
    """Compare force with mass times acceleration on a freely hung mass, and write the result to the journal.

    Parameters
    ----------
    folder
        Machine folder.
    port
        Port of the device.
    device
        Connected device.
    mass
        Total moving mass (kg).
    tell
        Function called with instructions and the verdict on each hit.
    operator
        Name of the operator.
    direction
        Direction of the accelerometer on the mass, for a DAQ with several.

    Returns
    -------
    MassCheck
        Calibration, where to correct a sensitivity, and the line in the journal.
    """
    result = measure_mass(folder, device, mass, tell, direction)
    entry = store_mass_result(folder, device, result, operator)
    return MassCheck(result, find_sensor_data(folder.machine.daq, port), entry)


SKEW_RECORDING_SECONDS = 2.0
"""Length of the recording of a common signal (s)."""


class SkewCheck(NamedTuple):
    """Measured skew of a device, and where to enter it."""

    measured: acquisition.MeasuredSkew
    """Skew of channel 1 against channel 0."""
    sample_rate: float
    """Sample rate of the measurement (Hz)."""
    channel: Channel
    """Channel 1, with the skew entered so far."""
    place: SensorDataLocation | None
    """Location of the skews in the device, None if machine.toml has them."""


def check_skew(folder: MachineFolder, port: str, device: Device, tell: Callable[[str], None]) -> SkewCheck:
    """Record a signal fed to both inputs of a connected device and measure their skew.

    Parameters
    ----------
    folder
        Machine folder.
    port
        Port of the device.
    device
        Connected device with two channels.
    tell
        Function called with a sentence on what to do.

    Returns
    -------
    SkewCheck
        Measured skew, and where to enter it.

    Raises
    ------
    DataError
        The device does not have exactly two channels.
    """
    if len(device.channels) != 2:
        n = len(device.channels)
        raise acquisition.DataError(
            f"a skew check needs two inputs, but the DAQ has {n}. Add both inputs as [[daq.channel]]."
        )
    rate = check_device_rate(folder, device)
    tell(f"recording {SKEW_RECORDING_SECONDS:g} s, join both inputs with a T-piece and feed noise or taps")
    device.start()
    (first, second), _ = collect_codes(device.blocks(), SKEW_RECORDING_SECONDS * rate)
    device.stop()
    place = find_sensor_data(folder.machine.daq, port)
    return SkewCheck(acquisition.measure_skew(first, second, rate), rate, device.channels[1], place)
