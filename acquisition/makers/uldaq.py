"""Measurement Computing devices on USB, such as the USB-1608 series, through uldaq. They feed no IEPE sensors."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.channel import SensorInput
from acquisition.errors import DeviceError
from acquisition.makers.library import installed_library, load_library, only_inputs
from acquisition.makers.library_device import LibraryDevice, Piece
from acquisition.source import DeviceAddress, DeviceIdentity

EXTRA = "uldaq"
RATE = 50000.0
"""Sample rate where none is asked for (Hz)."""
BUFFER_TIME = 2.0
"""Length of the ring of scans (s); whoever reads later than that has lost some."""
POLL_TIME = 0.01
"""Time between two looks whether scans have come (s)."""


def search_uldaq() -> Sequence[DeviceAddress]:
    """Devices on USB."""
    library = installed_library("uldaq", EXTRA)
    if library is None:
        return []
    devices = library.get_daq_device_inventory(library.InterfaceType.USB)
    return [DeviceAddress(f"uldaq:{entry.unique_id}", _identity(entry), entry.product_name) for entry in devices]


def open_uldaq(port: str, inputs: Sequence[SensorInput], sample_rate: float | None = None) -> LibraryDevice:
    """The device "uldaq:SERIAL NUMBER". Both inputs have one range; the rate is the nearest that it has."""
    library = load_library("uldaq", EXTRA)
    wanted = port.removeprefix("uldaq:")
    entries = [
        entry
        for entry in library.get_daq_device_inventory(library.InterfaceType.USB)
        if entry.unique_id.casefold() == wanted.casefold()
    ]
    if not entries:
        raise DeviceError(f"{wanted!r} is not plugged in", "`lobewatch ports` lists what there is")
    device = library.DaqDevice(entries[0])
    try:
        device.connect()
        reader = UldaqReader(library, device, inputs, sample_rate or RATE)
    except library.ULException as error:
        device.release()
        raise DeviceError(f"{port} cannot be opened ({error})", "check that no other program uses it") from error
    except BaseException:
        device.release()
        raise
    channels = tuple(replace(sensor.channel, adc_bits=reader.bits) for sensor in inputs)
    return LibraryDevice(port, reader, _identity(entries[0]), channels, reader.rate, "scan count")


class UldaqReader:
    """Reads the ring that a continuous scan fills."""

    def __init__(self, library: Any, device: Any, inputs: Sequence[SensorInput], rate: float) -> None:
        """The connected device; ValueError for inputs or ranges that it does not have."""
        self.errors: tuple[type[Exception], ...] = (library.ULException,)
        self._library, self._device, self._inputs = library, device, device.get_ai_device()
        info = self._inputs.get_info()
        numbers = [sensor.number for sensor in inputs]
        self._mode = library.AiInputMode.SINGLE_ENDED
        only_inputs(numbers, info.get_num_chans_by_mode(self._mode), device.get_descriptor().product_name)
        self._range = _range(library, info.get_ranges(self._mode), {sensor.channel.full_scale for sensor in inputs})
        self._first, self._last = min(numbers), max(numbers)
        self._rows = [number - self._first for number in numbers]
        self.bits = int(info.get_resolution())
        """Resolution of the converter."""
        self._size = round(rate * BUFFER_TIME)
        self._ring = library.create_float_buffer(self._last - self._first + 1, self._size)
        self._read = 0
        self.rate = rate
        """Sample rate that the device has (Hz), known once it was started."""
        self.start()
        self.stop()

    def start(self) -> None:
        """See Reader."""
        self._read = 0
        options = self._library.ScanOption.CONTINUOUS, self._library.AInScanFlag.DEFAULT
        place = self._first, self._last, self._mode, self._range
        self.rate = float(self._inputs.a_in_scan(*place, self._size, self.rate, *options, self._ring))

    def read(self, timeout: float) -> Piece | None:
        """See Reader."""
        deadline = time.monotonic() + timeout
        while (come := self._inputs.get_scan_status()[1].current_scan_count) == self._read:
            if time.monotonic() > deadline:
                return None
            time.sleep(POLL_TIME)
        lost = max(come - self._read - self._size // 2, 0)  # half of the ring: the rest may be written meanwhile
        places = np.arange(self._read + lost, come) % self._size
        self._read = come
        volts: NDArray[np.float64] = np.frombuffer(self._ring).reshape(self._size, -1)[places].T[self._rows]
        return Piece(volts, lost)

    def stop(self) -> None:
        """See Reader."""
        self._inputs.scan_stop()

    def close(self) -> None:
        """See Reader."""
        self._device.disconnect()
        self._device.release()

    def fault(self) -> str:
        """Nothing: the device does not tell."""
        return ""


def _identity(entry: Any) -> DeviceIdentity:
    return DeviceIdentity(entry.product_name, entry.unique_id)


def _range(library: Any, ranges: Sequence[Any], wanted: set[float]) -> Any:
    """The range of the device with this full scale (V); ValueError for two, or for one it does not have."""
    volts = {scale: f"BIP{scale:g}VOLTS" for scale in wanted}
    names = {entry.name for entry in ranges}
    if len(wanted) == 1 and names.issuperset(volts.values()):
        return getattr(library.Range, *volts.values())
    bipolar = sorted(name.removeprefix("BIP").removesuffix("VOLTS") for name in names if name.startswith("BIP"))
    listed = ", ".join(bipolar)
    given = " and ".join(f"{scale:g}" for scale in sorted(wanted))
    raise ValueError(f"range_v={given}: both inputs need one range of this device: {listed} V")
