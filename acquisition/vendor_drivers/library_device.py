"""Devices read through the Python library of their vendor."""

import time
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np

from acquisition.arrays import Codes, Floats
from acquisition.channel import Block, Channel, SensorInput
from acquisition.errors import DeviceError
from acquisition.source import ClosedOnExit, DeviceIdentity, Event

EXTRAS = {"daqhats": "mcc172", "labjack": "ljm", "nidaqmx": "nidaqmx", "sounddevice": "audio", "uldaq": "uldaq"}
"""Extra of lobewatch that installs each vendor library."""
OPEN_REMEDY = "List the connected devices with `acquisition.scan_ports`"
"""Remedy for a device that cannot be opened."""
BLOCK_TIME = 0.02
"""Duration of the blocks that a library delivers (s)."""
LIBRARY_SILENCE_TIMEOUT = 3.0
"""Time without scans after which a started device has failed (s)."""
LIBRARY_READ_TIMEOUT = 0.2
"""Time that a reader may wait for scans (s)."""


def load_library(module: str) -> Any:  # a module without types
    """Import a module of a vendor library. DeviceError with the install command if that fails.

    Libraries raise OSError if their own C library is missing.
    """
    package = module.partition(".")[0]
    try:
        return import_module(module)
    except (ImportError, OSError) as error:
        remedy = f"Run pip install 'lobewatch[{EXTRAS[package]}]', and install the vendor driver (docs/devices.md)"
        text = " ".join(str(error).split())
        raise DeviceError(f"the library {package} cannot be used ({text})", remedy) from error


@contextmanager
def convert_errors(errors: tuple[type[Exception], ...], failure: str, remedy: str = OPEN_REMEDY) -> Iterator[None]:
    """Convert errors of a vendor library to DeviceError. failure: finding, for people."""
    try:
        yield
    except errors as error:
        raise DeviceError(f"{failure} ({' '.join(str(error).split())})", remedy) from error


def check_input_numbers(inputs: Sequence[SensorInput], count: int, device: str) -> None:
    for sensor in inputs:
        if sensor.number >= count:
            text = f"input={sensor.number} does not exist, because {device} has inputs 0 to {count - 1}"
            raise ValueError(f"{text}. Correct input in [[daq.channel]].")


class VoltageBlock(NamedTuple):
    """Consecutive scans as a library returns them."""

    volts: Floats
    """Voltages at the inputs (V), shape (n_channels, n_scans)."""
    lost_before: int = 0
    """Number of scans lost before this block, 1 if the library reports a loss without a number."""


class LibraryReader:
    """Interface to a vendor library, implemented once per library."""

    errors: tuple[type[Exception], ...]
    """Exceptions that the library raises."""

    def start(self) -> None:
        """Start sampling."""

    def read(self, timeout: float) -> VoltageBlock | None:
        """Return the scans that have arrived, None if none has arrived in time.

        Parameters
        ----------
        timeout
            Longest time to wait (s).
        """
        raise NotImplementedError

    def stop(self) -> None:
        """End sampling. Harmless if it has ended."""

    def close(self) -> None:
        """Release the device."""

    def fault(self) -> str:
        """Describe a sensor that is not connected. Empty if there is none or the library cannot detect it."""
        return ""


class StreamReader(LibraryReader):
    """Reader of a library whose stream or task is started, stopped and closed."""

    _stream: Any

    def start(self) -> None:
        self._stream.start()

    def stop(self) -> None:
        self._stream.stop()

    def close(self) -> None:
        self._stream.close()


@dataclass
class LibraryDevice(ClosedOnExit):
    """Device read through a vendor library. Codes are the voltages in steps of each channel's converter."""

    address: str
    """Address, as [daq] port names it."""
    reader: LibraryReader
    """Reader of its scans."""
    identity: DeviceIdentity
    """Model, serial number and firmware."""
    channels: tuple[Channel, ...]
    """Channels, in the order of the reader's rows."""
    sample_rate: float
    """Sample rate (Hz)."""
    loss_detection: str
    """Method by which lost scans are detected, in two words."""
    follows_clock: bool = True
    """True if its scans follow the clock."""
    events: deque[Event] = field(default_factory=deque)
    """Events at the device. Such a device has no button."""
    _running: bool = False

    @property
    def fault(self) -> str:
        """Sensor fault and its remedy while it lasts."""
        with self._convert_errors():
            return self.reader.fault()

    def start(self) -> None:
        with self._convert_errors():
            self.reader.start()
        self._running = True

    def stop(self) -> None:
        """End the stream. `blocks` ends too."""
        self._running = False
        with self._convert_errors():
            self.reader.stop()

    def close(self) -> None:
        """Stop and release the device. A device that is gone is no error here."""
        self._running = False
        for end in (self.reader.stop, self.reader.close):
            with suppress(*self.reader.errors):
                end()

    def blocks(self) -> Iterator[Block]:
        """Yield blocks as they arrive. DeviceError if the device goes away or falls silent."""
        scan, last_arrival = 0, time.monotonic()
        while self._running:
            with self._convert_errors():
                block = self.reader.read(LIBRARY_READ_TIMEOUT)
            if block is not None:
                scan += block.lost_before
                yield Block(scan, self._codes(block.volts), lost_before=block.lost_before)
                scan, last_arrival = scan + block.volts.shape[1], time.monotonic()
            elif time.monotonic() - last_arrival > LIBRARY_SILENCE_TIMEOUT:
                text = f"the DAQ {self.address} has sent no samples for {LIBRARY_SILENCE_TIMEOUT:g} s"
                raise DeviceError(text, "Unplug the DAQ and plug it in again")

    def _codes(self, volts: Floats) -> Codes:
        rows = zip(self.channels, volts, strict=True)
        return np.array([channel.encode(row / channel.sensitivity) for channel, row in rows], np.int32)

    def _convert_errors(self) -> AbstractContextManager[None]:
        remedy = "Check the cable of the DAQ, and that no other program uses the DAQ"
        return convert_errors(self.reader.errors, f"the DAQ {self.address} has failed", remedy)
