"""The DAQ that a machine file names, opened."""

from __future__ import annotations

from acquisition import Device, DeviceError, FileSource, SensorPlace, find_driver, find_port, usb_identity
from acquisition.devices import named_package
from lobewatch.machine.settings.daq_tables import Daq

REPLAY = "file:"
"""Beginning of a port that is no port but a recording, whatever the driver."""


class Plug:
    """Opens one device again and again: a USB device wherever it is plugged in after the first time.

    A USB device without a serial number, and what is no USB device, is known by the name of its port alone.
    """

    def __init__(self, daq: Daq, port: str) -> None:
        """A device as [daq] sets it up; port: where it is the first time."""
        self._daq, self._port = daq, port
        self._identity: tuple[int, str] | None = None

    def open(self) -> Device:
        """Open as open_source does; DeviceError while the USB device is nowhere: no other at its port is touched."""
        if self._identity is not None and usb_identity(self._port) != self._identity:
            port = find_port(*self._identity)
            if port is None:
                number = self._identity[1]
                raise DeviceError(f"the DAQ with the USB serial number {number} is not plugged in", "plug it in")
            self._port = port
        source = open_source(self._daq, self._port)
        self._identity = self._identity or usb_identity(self._port)
        return source


def open_source(daq: Daq, port: str) -> Device:
    """A connected device on a port, as [daq] sets it up, or the hits of a recording, "file:PATH".

    Raises DeviceError where no device is there, DataError for a file without hits.
    """
    if port.startswith(REPLAY):
        return FileSource(port.removeprefix(REPLAY))
    with named_package(daq.driver, f"opening {port}"):
        return find_driver(daq.driver).open(port, daq.settings)


def sensor_place(daq: Daq, port: str) -> SensorPlace | None:
    """Place where the device on a port keeps the data of its sensors; None where machine.toml does."""
    return None if port.startswith(REPLAY) else find_driver(daq.driver).sensors
