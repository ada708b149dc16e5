"""LabJack T7 and T8 devices through LJM.

They do not power IEPE sensors, and sample their inputs one after the other.
"""

from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from typing import Any

import numpy as np

from acquisition.arrays import Floats
from acquisition.channel import SensorInput
from acquisition.source import DeviceAddress, DeviceIdentity
from acquisition.vendor_drivers import library_device
from acquisition.vendor_drivers.library_device import LibraryDevice, LibraryReader, VoltageBlock

T7_DEFAULT_RATE = 40000.0
"""Default sample rate (Hz) for two inputs of a T7, which samples 100 000 values a second."""
SKIPPED_SAMPLE_VALUE = -9999.0
"""Value that LJM inserts for a sample that the device had no room for."""
T7_INPUT_COUNT = 14
"""Number of analog inputs of a T7, AIN0 to AIN13."""
T7_RANGES = (10.0, 1.0, 0.1, 0.01)
"""Ranges of a T7 (V)."""


def search_ljm() -> Sequence[DeviceAddress]:
    """List the T7 and T8 devices on USB and in the network.

    Returns
    -------
    Sequence of DeviceAddress
        Addresses that `open_ljm` takes.

    Raises
    ------
    DeviceError
        The library is not installed.
    """
    library = library_device.load_library("labjack.ljm")
    constants = library.constants
    names = {constants.dtT7: "LabJack T7", constants.dtT8: "LabJack T8"}
    count, kinds, _, numbers, _ = library.listAll(constants.dtANY, constants.ctANY)
    listed = {numbers[k]: names[kinds[k]] for k in range(count) if kinds[k] in names}
    return [DeviceAddress(f"ljm:{number}", DeviceIdentity(name, str(number)), name) for number, name in listed.items()]


def open_ljm(port: str, inputs: Sequence[SensorInput], sample_rate: float | None = None) -> LibraryDevice:
    """Open a LabJack T7 or T8.

    Parameters
    ----------
    port
        "ljm:SERIAL NUMBER", or with its IP address or name.
    inputs
        Sensors with the numbers of their inputs.
    sample_rate
        Requested sample rate (Hz), None for 40 kHz. The nearest one of the device is used.

    Returns
    -------
    LibraryDevice
        Connected device.

    Raises
    ------
    DeviceError
        The library or the device is missing, or the device cannot be opened.
    ValueError
        The device does not have an input or range.
    """
    library = library_device.load_library("labjack.ljm")
    library_device.check_input_numbers(inputs, T7_INPUT_COUNT, "a LabJack T7")
    for sensor in inputs:
        if sensor.channel.full_scale not in T7_RANGES:
            listed = ", ".join(f"{scale:g}" for scale in T7_RANGES)
            scale = sensor.channel.full_scale
            raise ValueError(f"range_v={scale:g} is not one of {listed}, the ranges of a LabJack T7")
    with library_device.convert_errors((library.LJMError,), f"{port} cannot be opened"), ExitStack() as cleanup:
        handle = library.openS("ANY", "ANY", port.removeprefix("ljm:"))
        cleanup.callback(library.close, handle)
        for sensor in inputs:
            library.eWriteName(handle, f"AIN{sensor.number}_RANGE", sensor.channel.full_scale)
        reader = LjmReader(library, handle, [sensor.number for sensor in inputs], sample_rate or T7_DEFAULT_RATE)
        serial = library.getHandleInfo(handle)[2]
        firmware = library.eReadName(handle, "FIRMWARE_VERSION")
        cleanup.pop_all()
    identity = DeviceIdentity("LabJack", str(serial), f"{firmware:.4f}")
    channels = tuple(replace(sensor.channel, adc_bits=16) for sensor in inputs)
    return LibraryDevice(port, reader, identity, channels, reader.rate, "skipped samples")


class LjmReader(LibraryReader):
    """Reader of an LJM stream."""

    def __init__(self, library: Any, handle: int, numbers: Sequence[int], rate: float) -> None:
        """Take the opened device. Starting it once gives its true rate (Hz)."""
        self.errors: tuple[type[Exception], ...] = (library.LJMError,)
        self._library, self._handle = library, handle
        self._inputs = library.namesToAddresses(len(numbers), [f"AIN{number}" for number in numbers])[0]
        self.rate = rate
        """Sample rate of the device (Hz), known after the first start."""
        self.start()
        self.stop()

    def start(self) -> None:
        self._lost, self._blocks = 0, deque[VoltageBlock]()
        size = round(self.rate * library_device.BLOCK_TIME)
        self.rate = float(self._library.eStreamStart(self._handle, size, len(self._inputs), self._inputs, self.rate))

    def read(self, _timeout: float) -> VoltageBlock | None:
        """Return the next block. LJM waits by itself, and raises its error if nothing arrives."""
        if not self._blocks:
            self._blocks.extend(self._split_runs(np.array(self._library.eStreamRead(self._handle)[0])))
        return self._blocks.popleft() if self._blocks else None

    def _split_runs(self, values: Floats) -> Iterator[VoltageBlock]:
        """Yield the runs of scans without a skipped sample."""
        volts = values.reshape(-1, len(self._inputs)).T
        is_complete = (volts != SKIPPED_SAMPLE_VALUE).all(axis=0)
        for run in np.split(np.arange(is_complete.size), np.flatnonzero(np.diff(is_complete)) + 1):
            if is_complete[run[0]]:
                yield VoltageBlock(volts[:, run], self._lost)
                self._lost = 0
            else:
                self._lost += run.size

    def stop(self) -> None:
        self._library.eStreamStop(self._handle)

    def close(self) -> None:
        self._library.close(self._handle)
