"""List, find and open serial ports, and explain why one cannot be opened."""

from __future__ import annotations

import contextlib
import os
import select
import socket
import sys
import threading
import time
from collections import deque
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import serial
from serial.tools import list_ports
from serial.tools.list_ports import comports

from acquisition.errors import DeviceError


def find_usb_port(vid: int, serial_number: str) -> str | None:
    """The port of the USB device with this vendor id and serial number; None while it is not plugged in.

    A look at the list of ports, for a caller that waits for a device to come back.
    """
    wanted = (vid, serial_number.casefold())
    ports = (
        port.device for port in list_ports.comports() if (port.vid, (port.serial_number or "").casefold()) == wanted
    )
    return next(ports, None)


def find_usb_identity(port: str) -> tuple[int, str] | None:
    """Vendor id and serial number of what is plugged in at a port; None where it is no USB device or has no number."""
    for listed in list_ports.comports(include_links=True):
        if listed.device == port and listed.vid is not None and listed.serial_number:
            return listed.vid, listed.serial_number
    return None


@dataclass(frozen=True)
class PortInfo:
    """What the system knows of a port; pseudo-terminals are never listed."""

    device: str
    """Path or name to open, e.g. /dev/ttyACM0 or COM3."""
    vendor: int | None = None
    """USB vendor; None where it is no USB device."""
    product: int | None = None
    """USB product."""
    serial_number: str = ""
    """Serial number of the USB device."""
    description: str = ""
    """Description in the system's words."""


def list_serial_ports() -> list[PortInfo]:
    """All ports, by name."""
    return [
        PortInfo(port.device, port.vid, port.pid, port.serial_number or "", port.description or "")
        for port in sorted(comports())
    ]


NO_PORTS_REMEDIES = {
    "linux": "plug the DAQ in and look at the last lines of `sudo dmesg`; hand it through to a container or "
    "virtual machine",
    "darwin": "plug the DAQ in and look for /dev/cu.usbmodem*; allow the accessory where macOS asks",
    "win32": "plug the DAQ in and look under Ports (COM & LPT) of the Device Manager",
}
"""Cure by sys.platform."""


def explain_no_ports(platform: str | None = None) -> str:
    """What to do where no serial port exists, one sentence; platform as `sys.platform` names it, None: this one."""
    cure = NO_PORTS_REMEDIES.get(platform or sys.platform, "plug the DAQ in")
    return (
        f"No serial port on this computer: {cure}; try another cable, some carry no data. "
        "A DATAQ device shows none until its LED blinks yellow (CDC mode)."
    )


def explain_open_error(port: str, error: Exception, platform: str = sys.platform) -> DeviceError:
    """The error to raise, with the system's words and what to do."""
    text = str(error)
    busy = "another program uses it: close that program"
    if platform == "linux" and not port.startswith("socket:"):
        busy += f" (`sudo fuser -v {port}` names it; ModemManager lets go after half a minute)"
    missing = "check the cable and the port's name (`lobewatch ports` lists all)"
    hints = {
        "lock": busy,
        "busy": busy,
        "Permission denied": busy if platform == "win32" else _explain_permission(port, platform),
        "Access is denied": busy,
        "No such file": missing,
        "FileNotFound": missing,
        "refused": "nothing listens there: start the device or emulator first",
    }
    cure = next((hint for word, hint in hints.items() if word in text), "check the port's name and the cable")
    number = (error.errno or 0) if isinstance(error, OSError) else 0
    reason = os.strerror(number) if number > 0 else text  # a host that has no address comes with a negative number
    return DeviceError(f"port {port} cannot be opened ({reason})", cure)


def _explain_permission(port: str, platform: str) -> str:
    """The exact fix; on Linux the port's group is what its owner must belong to."""
    if platform != "linux":
        return "you may not use it: ask for the rights of an administrator"
    try:
        group = Path(port).group()
    except (OSError, KeyError):
        group = "dialout"
    return f"you may not use it: sudo usermod -aG {group} $USER, then log out and in again"


try:
    from termios import error as TermiosError  # noqa: N812  (not an OSError, and not there on Windows)
except ImportError:
    TermiosError = OSError  # type: ignore[misc,assignment]

MAX_UNREAD_BYTES = 16 << 20
"""Bytes kept for a slow consumer: ten seconds at 1.6 MB/s."""


class SerialLink:
    """An open port; `read` hands over what the reader thread has gathered."""

    def __init__(self, port: str, baud_rate: int = 9600) -> None:
        """Open the port for this program alone; DeviceError with the system's own words and a cure.

        baud_rate: of a port that is no USB device itself (baud); such a one has none.
        """
        self.port = port
        try:
            self._serial = _open_port(port, baud_rate)
        except (OSError, ValueError, TermiosError) as error:
            raise explain_open_error(port, error) from error
        self._chunks: deque[bytes] = deque()
        self._waiting = 0
        self.overruns = 0
        """How often the consumer was so late that all that waited was thrown away."""
        self._arrived = threading.Condition()
        self._running = True
        self._failure: Exception | None = None
        self._reader = threading.Thread(target=self._read_all, name=f"reader {port}", daemon=True)
        self._reader.start()

    def write(self, data: bytes) -> None:
        """Send bytes; DeviceError where the device is gone."""
        try:
            self._serial.write(data)
        except serial.SerialTimeoutException as error:
            raise DeviceError(
                f"the DAQ on {self.port} takes no commands", "switch it off and on and repeat the command"
            ) from error
        except (OSError, TermiosError) as error:
            raise self._unplugged() from error

    def read(self, timeout: float) -> bytes:
        """All that has arrived, after at most timeout (s); empty where nothing came. DeviceError: unplugged."""
        deadline = time.monotonic() + timeout
        with self._arrived:
            while not self._chunks:
                if self._failure is not None:
                    raise self._unplugged() from self._failure
                if not self._arrived.wait(max(deadline - time.monotonic(), 0)):
                    return b""
            chunks, self._chunks, self._waiting = self._chunks, deque(), 0
        return b"".join(chunks)  # outside the lock: the reader does not wait for it

    def close(self) -> None:
        """Stop the reader and give the port back."""
        self._running = False
        with contextlib.suppress(OSError, AttributeError, TermiosError):
            self._serial.cancel_read()
        self._reader.join(timeout=2.0)
        with contextlib.suppress(OSError, TermiosError):
            self._serial.close()

    def _read_all(self) -> None:
        try:
            while self._running:
                data = self._serial.read(1)
                if waiting := self._serial.in_waiting:
                    data += self._serial.read(waiting)  # one piece: the consumer is not woken for its first byte
                self._keep(data)
        except (OSError, TermiosError, TypeError) as error:  # TypeError: pyserial's read after a hang-up
            with self._arrived:
                self._failure = error
                self._arrived.notify()

    def _keep(self, data: bytes) -> None:
        with self._arrived:
            if self._waiting + len(data) > MAX_UNREAD_BYTES:
                self._chunks.clear()  # the gap shows in the scan indices of the frames that follow
                self._waiting = 0
                self.overruns += 1
            if data:
                self._chunks.append(data)
                self._waiting += len(data)
                self._arrived.notify()

    def _unplugged(self) -> DeviceError:
        return DeviceError(f"the DAQ on {self.port} was unplugged or switched off", "plug it in and repeat the command")


class _TcpPort:
    """What SerialLink needs of a port, over TCP: pyserial's own socket:// hands over one byte a call."""

    def __init__(self, host: str, number: int) -> None:
        self._socket = socket.create_connection((host, number), timeout=2.0)

    @property
    def in_waiting(self) -> int:
        """How much to ask for: as TCP does not tell how much there is, as much as there may be."""
        return 65536 if select.select([self._socket], [], [], 0)[0] else 0

    def read(self, size: int) -> bytes:
        if not select.select([self._socket], [], [], 0.1)[0]:
            return b""
        data = self._socket.recv(size)
        if not data:
            raise ConnectionError("the other end has hung up")
        return data

    def write(self, data: bytes) -> None:
        self._socket.sendall(data)

    def cancel_read(self) -> None:
        """read() comes back by itself within 0.1 s."""

    def close(self) -> None:
        self._socket.close()


def _open_port(port: str, baud_rate: int) -> Any:  # a pyserial port, which has no types, or a _TcpPort
    url = urlsplit(port)
    if url.scheme == "socket":
        if not url.hostname or not url.port:
            raise ValueError("socket://HOST:PORT is expected")
        return _TcpPort(url.hostname, url.port)
    opened = serial.Serial(port, baud_rate, timeout=0.1, write_timeout=2.0, exclusive=True)
    if hasattr(opened, "set_buffer_size"):  # Windows only
        opened.set_buffer_size(rx_size=1 << 20)
    return opened
