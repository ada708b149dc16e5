"""NI devices, such as the IEPE modules NI 9234 and 9230, through NI-DAQmx."""

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from typing import Any

import numpy as np

from acquisition.channel import Channel, SensorInput
from acquisition.source import DeviceAddress, DeviceIdentity
from acquisition.vendor_drivers import library_device
from acquisition.vendor_drivers.library_device import LibraryDevice, StreamReader, VoltageBlock

NIDAQMX_BUFFER_TIME = 10.0
"""Length of the NI-DAQmx buffer (s). A late reader gets an error there, never a gap."""
SAMPLES_NOT_AVAILABLE_ERROR = -200284
"""NI-DAQmx error for samples that have not arrived in time."""


def search_nidaqmx() -> Sequence[DeviceAddress]:
    """List the NI devices and modules with at least two analog inputs.

    Returns
    -------
    Sequence of DeviceAddress
        Addresses that `open_nidaqmx` takes, empty if NI's driver is not installed.

    Raises
    ------
    DeviceError
        The library is not installed.
    """
    try:
        devices = [*library_device.load_library("nidaqmx.system").System.local().devices]
        listed = [(device, len(device.ai_physical_chans)) for device in devices]
    except library_device.load_library("nidaqmx.errors").Error:  # NI's own driver is not installed
        return []
    usable = [(device, f"{count} inputs") for device, count in listed if count >= 2]
    return [DeviceAddress(f"nidaqmx:{device.name}", _read_identity(device), text) for device, text in usable]


def open_nidaqmx(port: str, inputs: Sequence[SensorInput], sample_rate: float | None = None) -> LibraryDevice:
    """Open an NI device or module.

    An input that powers its sensor is AC-coupled. The ranges of the channels are those that the device really has.

    Parameters
    ----------
    port
        "nidaqmx:NAME" with the name that NI's software shows, e.g. "nidaqmx:cDAQ1Mod1".
    inputs
        Sensors with the numbers of their inputs.
    sample_rate
        Requested sample rate (Hz), None for the highest. The device uses its next higher one (NI 9234: 51.2 kHz / n).

    Returns
    -------
    LibraryDevice
        Connected device.

    Raises
    ------
    DeviceError
        The library or the device is missing, or the device cannot be opened.
    ValueError
        The device does not have an input.
    """
    library = library_device.load_library("nidaqmx")
    errors = (library_device.load_library("nidaqmx.errors").Error,)
    with library_device.convert_errors(errors, f"{port} cannot be opened"), ExitStack() as cleanup:
        device = library_device.load_library("nidaqmx.system").Device(port.removeprefix("nidaqmx:"))
        library_device.check_input_numbers(inputs, len(device.ai_physical_chans), device.product_type)
        task = library.Task()
        cleanup.callback(task.close)
        channels = tuple(_add_input(task, device, sensor) for sensor in inputs)
        wanted = sample_rate or device.ai_max_multi_chan_rate
        continuous = library_device.load_library("nidaqmx.constants").AcquisitionType.CONTINUOUS
        buffer = round(wanted * NIDAQMX_BUFFER_TIME)
        task.timing.cfg_samp_clk_timing(wanted, sample_mode=continuous, samps_per_chan=buffer)
        rate = float(task.timing.samp_clk_rate)
        reader = NidaqmxReader(task, len(inputs), rate)
        cleanup.pop_all()
        return LibraryDevice(port, reader, _read_identity(device), channels, rate, "buffer overrun")


class NidaqmxReader(StreamReader):
    """Reader of a task that samples continuously."""

    def __init__(self, task: Any, n_channels: int, rate: float) -> None:
        """Take the task with its inputs and its rate (Hz)."""
        self.errors: tuple[type[Exception], ...] = (library_device.load_library("nidaqmx.errors").Error,)
        self._stream = task
        self._reader = library_device.load_library("nidaqmx.stream_readers").AnalogMultiChannelReader(task.in_stream)
        self._shape = n_channels, round(rate * library_device.BLOCK_TIME)

    def read(self, timeout: float) -> VoltageBlock | None:
        volts = np.empty(self._shape)
        try:
            self._reader.read_many_sample(volts, self._shape[1], timeout)
        except self.errors as error:
            if getattr(error, "error_code", 0) == SAMPLES_NOT_AVAILABLE_ERROR:
                return None
            raise
        return VoltageBlock(volts)

    def fault(self) -> str:
        """Describe inputs whose IEPE loop is open."""
        stream = self._stream.in_stream
        if not stream.open_current_loop_chans_exist:
            return ""
        inputs = ", ".join(stream.open_current_loop_chans)
        return f"The IEPE supply of {inputs} has no current. Check the sensor and its cable."


def _read_identity(device: Any) -> DeviceIdentity:
    return DeviceIdentity(device.product_type, f"{device.serial_num:X}")


def _add_input(task: Any, device: Any, sensor: SensorInput) -> Channel:
    """Add an input to the task, powered if it feeds its sensor. Return the channel with its real range."""
    constants = library_device.load_library("nidaqmx.constants")
    scale = sensor.channel.full_scale
    entry = task.ai_channels.add_ai_voltage_chan(f"{device.name}/ai{sensor.number}", min_val=-scale, max_val=scale)
    currents = device.ai_current_int_excit_discrete_vals
    if sensor.iepe and currents:
        entry.ai_coupling = constants.Coupling.AC
        entry.ai_excit_src = constants.ExcitationSource.INTERNAL
        entry.ai_excit_val = max(currents)
    return replace(sensor.channel, adc_bits=24, full_scale=float(entry.ai_rng_high))
