"""Measurement Computing devices.

The MCC 172 has two IEPE inputs on a Raspberry Pi, read through daqhats. USB devices such as the USB-1608 series are
read through uldaq and do not power IEPE sensors.
"""

import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from typing import Any

import numpy as np

from acquisition.arrays import Floats
from acquisition.channel import SensorInput
from acquisition.errors import DeviceError
from acquisition.source import DeviceAddress, DeviceIdentity
from acquisition.vendor_drivers import library_device
from acquisition.vendor_drivers.library_device import LibraryDevice, LibraryReader, VoltageBlock

MCC172_MAX_RATE = 51200.0
"""Highest sample rate (Hz). The others are this rate divided by 2 to 256."""
MCC172_FULL_SCALE = 5.0
"""Only range (V)."""
MCC172_SYNC_TIMEOUT = 2.0
"""Time limit for synchronizing the converters (s). The documentation says 128 clock cycles."""


def search_mcc172() -> Sequence[DeviceAddress]:
    """List the boards on this Raspberry Pi.

    Returns
    -------
    Sequence of DeviceAddress
        Addresses that `open_mcc172` takes.

    Raises
    ------
    DeviceError
        The library is not installed.
    """
    library = library_device.load_library("daqhats")
    boards, identity = library.hat_list(filter_by_id=library.HatIDs.MCC_172), DeviceIdentity("MCC 172")
    return [DeviceAddress(f"mcc172:{board.address}", identity, f"{board.product_name}, 2 inputs") for board in boards]


def open_mcc172(port: str, inputs: Sequence[SensorInput], sample_rate: float | None = None) -> LibraryDevice:
    """Open an MCC 172 board.

    Parameters
    ----------
    port
        "mcc172:ADDRESS" with the address of the board, 0 to 7.
    inputs
        Sensors with the numbers of their inputs.
    sample_rate
        Requested sample rate (Hz), None for 51.2 kHz. The nearest one of the board is used.

    Returns
    -------
    LibraryDevice
        Connected device.

    Raises
    ------
    DeviceError
        The library or the board is missing, or the board cannot be opened.
    ValueError
        The address, an input or a range does not exist.
    """
    library = library_device.load_library("daqhats")
    address = port.removeprefix("mcc172:")
    if not address.isdigit():
        raise ValueError(f"port={port!r} has no board address. Give board 0 to 7, as in mcc172:0.")
    library_device.check_input_numbers(inputs, 2, "an MCC 172")
    for sensor in inputs:
        if sensor.channel.full_scale != MCC172_FULL_SCALE:
            scale = sensor.channel.full_scale
            raise ValueError(f"range_v={scale:g} is not supported. An MCC 172 has only ±{MCC172_FULL_SCALE:g} V.")
    with library_device.convert_errors((library.HatError,), f"{port} cannot be opened"):
        board = library.mcc172(int(address))
        for sensor in inputs:
            board.iepe_config_write(sensor.number, int(sensor.iepe))
        rate = _set_mcc172_rate(library, board, sample_rate or MCC172_MAX_RATE)
        identity = DeviceIdentity("MCC 172", board.serial(), board.firmware_version().version)
    channels = tuple(replace(sensor.channel, adc_bits=24) for sensor in inputs)
    reader = Mcc172Reader(library, board, [sensor.number for sensor in inputs], rate)
    return LibraryDevice(port, reader, identity, channels, rate, "buffer overrun")


class Mcc172Reader(LibraryReader):
    """Reader of a continuous scan of both inputs."""

    def __init__(self, library: Any, board: Any, numbers: Sequence[int], rate: float) -> None:
        """Take the opened board. numbers: its inputs in order. rate (Hz)."""
        self.errors: tuple[type[Exception], ...] = (library.HatError,)
        self._library, self._board, self._numbers = library, board, list(numbers)
        self._size = round(rate * library_device.BLOCK_TIME)

    def start(self) -> None:
        self._board.a_in_scan_start(0b11, 0, self._library.OptionFlags.CONTINUOUS)

    def read(self, timeout: float) -> VoltageBlock | None:
        """Return the next block. A scan that has overrun its buffer has ended: DeviceError."""
        scan = self._board.a_in_scan_read_numpy(self._size, timeout)
        if scan.hardware_overrun or scan.buffer_overrun:
            raise DeviceError("the MCC 172 lost samples and stopped", "Close other programs on this Raspberry Pi")
        volts = scan.data.reshape(-1, 2).T[self._numbers]
        return VoltageBlock(volts) if volts.size else None

    def stop(self) -> None:
        self._board.a_in_scan_stop()
        self._board.a_in_scan_cleanup()

    def close(self) -> None:
        """Switch off the sensor supply."""
        for number in self._numbers:
            self._board.iepe_config_write(number, 0)


def _set_mcc172_rate(library: Any, board: Any, rate: float) -> float:
    """Set the nearest rate, wait until the converters are synchronized, and return the rate (Hz)."""
    board.a_in_clock_config_write(library.SourceType.LOCAL, rate)
    deadline = time.monotonic() + MCC172_SYNC_TIMEOUT
    while not (clock := board.a_in_clock_config_read()).synchronized:
        if time.monotonic() > deadline:
            raise DeviceError("the converters of the MCC 172 do not synchronize", "Restart the Raspberry Pi")
        time.sleep(0.005)
    return float(clock.sample_rate_per_channel)


ULDAQ_DEFAULT_RATE = 50000.0
"""Default sample rate (Hz)."""
ULDAQ_RING_TIME = 2.0
"""Length of the ring buffer (s). A reader later than that has lost scans."""
ULDAQ_POLL_INTERVAL = 0.01
"""Time between two checks for new scans (s)."""


def search_uldaq() -> Sequence[DeviceAddress]:
    """List the Measurement Computing devices on USB.

    Returns
    -------
    Sequence of DeviceAddress
        Addresses that `open_uldaq` takes.

    Raises
    ------
    DeviceError
        The library is not installed.
    """
    library = library_device.load_library("uldaq")
    devices = library.get_daq_device_inventory(library.InterfaceType.USB)
    return [DeviceAddress(f"uldaq:{box.unique_id}", _read_uldaq_identity(box), box.product_name) for box in devices]


def open_uldaq(port: str, inputs: Sequence[SensorInput], sample_rate: float | None = None) -> LibraryDevice:
    """Open a Measurement Computing USB device. All inputs share one range.

    Parameters
    ----------
    port
        "uldaq:SERIAL NUMBER".
    inputs
        Sensors with the numbers of their inputs.
    sample_rate
        Requested sample rate (Hz), None for 50 kHz. The nearest one of the device is used.

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
    library = library_device.load_library("uldaq")
    wanted = port.removeprefix("uldaq:")
    listed = library.get_daq_device_inventory(library.InterfaceType.USB)
    entry = next((entry for entry in listed if entry.unique_id.casefold() == wanted.casefold()), None)
    if entry is None:
        raise DeviceError(f"the DAQ {wanted!r} is not plugged in", library_device.OPEN_REMEDY)
    device = library.DaqDevice(entry)
    errors, remedy = (library.ULException,), "Check that no other program uses the DAQ"
    with library_device.convert_errors(errors, f"{port} cannot be opened", remedy), ExitStack() as cleanup:
        cleanup.callback(device.release)
        device.connect()
        reader = UldaqReader(library, device, inputs, sample_rate or ULDAQ_DEFAULT_RATE)
        cleanup.pop_all()
    channels = tuple(replace(sensor.channel, adc_bits=reader.bits) for sensor in inputs)
    return LibraryDevice(port, reader, _read_uldaq_identity(entry), channels, reader.rate, "scan count")


class UldaqReader(LibraryReader):
    """Reader of the ring buffer that a continuous scan fills."""

    def __init__(self, library: Any, device: Any, inputs: Sequence[SensorInput], rate: float) -> None:
        """Take the connected device. ValueError for inputs or ranges that it does not have."""
        self.errors: tuple[type[Exception], ...] = (library.ULException,)
        self._library, self._device, self._inputs = library, device, device.get_ai_device()
        info = self._inputs.get_info()
        numbers = [sensor.number for sensor in inputs]
        self._mode = library.AiInputMode.SINGLE_ENDED
        count, name = info.get_num_chans_by_mode(self._mode), device.get_descriptor().product_name
        library_device.check_input_numbers(inputs, count, name)
        wanted = {sensor.channel.full_scale for sensor in inputs}
        self._range = _find_uldaq_range(library, info.get_ranges(self._mode), wanted)
        self._first, self._last = min(numbers), max(numbers)
        self._rows = [number - self._first for number in numbers]
        self.bits = int(info.get_resolution())
        """Resolution of the converter (bits)."""
        self._size = round(rate * ULDAQ_RING_TIME)
        self._ring = library.create_float_buffer(self._last - self._first + 1, self._size)
        self._read = 0
        self.rate = rate
        """Sample rate of the device (Hz), known after the first start."""
        self.start()
        self.stop()

    def start(self) -> None:
        self._read = 0
        options = self._library.ScanOption.CONTINUOUS, self._library.AInScanFlag.DEFAULT
        place = self._first, self._last, self._mode, self._range
        self.rate = float(self._inputs.a_in_scan(*place, self._size, self.rate, *options, self._ring))

    def read(self, timeout: float) -> VoltageBlock | None:
        deadline = time.monotonic() + timeout
        while (count := self._inputs.get_scan_status()[1].current_scan_count) == self._read:
            if time.monotonic() > deadline:
                return None
            time.sleep(ULDAQ_POLL_INTERVAL)
        lost = max(count - self._read - self._size // 2, 0)  # half of the ring: the rest may be written meanwhile
        places = np.arange(self._read + lost, count) % self._size
        self._read = count
        volts: Floats = np.frombuffer(self._ring).reshape(self._size, -1)[places].T[self._rows]
        return VoltageBlock(volts, lost)

    def stop(self) -> None:
        self._inputs.scan_stop()

    def close(self) -> None:
        self._device.disconnect()
        self._device.release()


def _read_uldaq_identity(entry: Any) -> DeviceIdentity:
    return DeviceIdentity(entry.product_name, entry.unique_id)


def _find_uldaq_range(library: Any, ranges: Sequence[Any], wanted: set[float]) -> Any:
    """Find the range with this full scale (V). ValueError for two, or for one the device does not have."""
    volts = {scale: f"BIP{scale:g}VOLTS" for scale in wanted}
    names = {entry.name for entry in ranges}
    if len(wanted) == 1 and names.issuperset(volts.values()):
        return getattr(library.Range, *volts.values())
    bipolar = sorted(name.removeprefix("BIP").removesuffix("VOLTS") for name in names if name.startswith("BIP"))
    given = " and ".join(f"{scale:g}" for scale in sorted(wanted))
    raise ValueError(f"range_v={given} must be one of {', '.join(bipolar)} V, equal for all inputs")
