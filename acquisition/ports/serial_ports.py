"""List, find and open serial ports, and explain why one cannot be opened."""

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
    """Find the port of a USB device, whose number may change when it is plugged in again.

    Parameters
    ----------
    vid
        USB vendor id.
    serial_number
        Serial number of the USB device, in any case.

    Returns
    -------
    str or None
        Port, None while the device is not plugged in.
    """
    wanted = (vid, serial_number.casefold())
    ports = list_ports.comports()
    return next((port.device for port in ports if (port.vid, (port.serial_number or "").casefold()) == wanted), None)


def find_usb_identity(port: str) -> tuple[int, str] | None:
    """Find the USB device on a port.

    Parameters
    ----------
    port
        Port name.

    Returns
    -------
    tuple of int and str, or None
        USB vendor id and serial number, None if it is no USB device or has no number.
    """
    for listed in list_ports.comports(include_links=True):
        if listed.device == port and listed.vid is not None and listed.serial_number:
            return listed.vid, listed.serial_number
    return None


@dataclass(frozen=True)
class PortInfo:
    """Port, as the system describes it. Pseudo-terminals are never listed."""

    device: str
    """Path or name to open, e.g. /dev/ttyACM0 or COM3."""
    vendor: int | None = None
    """USB vendor id, None if it is no USB device."""
    product: int | None = None
    """USB product id."""
    serial_number: str = ""
    """Serial number of the USB device."""
    description: str = ""
    """Description by the system."""


def list_serial_ports() -> list[PortInfo]:
    """List all serial ports.

    Returns
    -------
    list of PortInfo
        Ports, sorted by name.
    """
    return [
        PortInfo(port.device, port.vid, port.pid, port.serial_number or "", port.description or "")
        for port in sorted(comports())
    ]


NO_PORTS_REMEDIES = {
    "linux": "Look for the DAQ at the end of `sudo dmesg`. In a container or virtual machine, pass the DAQ through.",
    "darwin": "Look for a port /dev/cu.usbmodem*, and allow the accessory if macOS asks.",
    "win32": "Look for the DAQ under Ports (COM & LPT) in the Device Manager.",
}
"""Remedy by sys.platform."""


def explain_no_ports(platform: str | None = None) -> str:
    """Return the finding that no serial port exists, with its remedies.

    Parameters
    ----------
    platform
        Platform as in `sys.platform`, None for this one.

    Returns
    -------
    str
        Finding and remedies.
    """
    plug_in = "No serial port on this computer. Plug the DAQ in, with a cable that carries data."
    dataq = "A DATAQ device needs CDC mode (LED blinks yellow)."
    return " ".join(filter(None, (plug_in, NO_PORTS_REMEDIES.get(platform or sys.platform), dataq)))


def explain_open_error(port: str, error: Exception, platform: str = sys.platform) -> DeviceError:
    """Return the error to raise, with the message of the system and the remedy."""
    text = str(error)
    busy = "Close the other program that uses the port"
    if platform == "linux" and not port.startswith("socket:"):
        busy += f" (find the program with `sudo fuser -v {port}`). If the program is ModemManager, wait half a minute"
    missing = "Check the cable and the port name (list all ports with `acquisition.scan_ports`)"
    hints = {
        **dict.fromkeys(("lock", "busy"), busy),
        "Permission denied": busy if platform == "win32" else _explain_permission(port, platform),
        "Access is denied": busy,
        **dict.fromkeys(("No such file", "FileNotFound"), missing),
        "refused": "Start the device or the emulator, then repeat the command",
    }
    cure = next((hint for word, hint in hints.items() if word in text), "Check the port name and the cable")
    number = (error.errno or 0) if isinstance(error, OSError) else 0
    reason = os.strerror(number) if number > 0 else text  # a host that has no address comes with a negative number
    return DeviceError(f"port {port} cannot be opened ({reason})", cure)


def _explain_permission(port: str, platform: str) -> str:
    """Return the exact remedy. On Linux the user must belong to the port's group."""
    if platform != "linux":
        return "Ask an administrator for permission to use the port"
    try:
        group = Path(port).group()
    except (OSError, KeyError):
        group = "dialout"
    return f"Run sudo usermod -aG {group} $USER, then log out and in again"


try:
    from termios import error as TermiosError  # noqa: N812  (not an OSError, and not there on Windows)
except ImportError:
    TermiosError = OSError  # type: ignore[misc,assignment]

SILENCE_TIMEOUT = 3.0
"""Time without scans after which a device that streams has failed (s). One that resets when opened needs two."""
MAX_UNREAD_BYTES = 16 << 20
"""Bytes kept for a slow consumer: ten seconds at 1.6 MB/s."""


class SerialLink:
    """Open serial port with a reader thread. `read` returns what the thread has received.

    Parameters
    ----------
    port
        Serial device name or socket://host:port. It is opened exclusively.
    baud_rate
        Rate of a port that is no USB device itself (baud).

    Raises
    ------
    DeviceError
        The port cannot be opened. The error has the system's words and a remedy.
    """

    def __init__(self, port: str, baud_rate: int = 9600) -> None:
        self.port = port
        try:
            self._serial = _open_port(port, baud_rate)
        except (OSError, ValueError, TermiosError) as error:
            raise explain_open_error(port, error) from error
        self._chunks: deque[bytes] = deque()
        self._waiting = 0
        self.overruns = 0
        """Number of times the consumer was so late that all unread bytes were discarded."""
        self._arrived = threading.Condition()
        self._running = True
        self._failure: Exception | None = None
        self._reader = threading.Thread(target=self._read_all, name=f"reader {port}", daemon=True)
        self._reader.start()

    def write(self, data: bytes) -> None:
        """Send bytes. DeviceError if the device is gone.

        Parameters
        ----------
        data
            Bytes to send.
        """
        try:
            self._serial.write(data)
        except serial.SerialTimeoutException as error:
            text = f"the DAQ on {self.port} does not accept commands"
            raise DeviceError(text, "Switch the DAQ off and on, then repeat the command") from error
        except (OSError, TermiosError) as error:
            raise self._unplugged() from error

    def read(self, timeout: float) -> bytes:
        """Return all bytes that have arrived, empty if none has. DeviceError if the device was unplugged.

        Parameters
        ----------
        timeout
            Longest time to wait (s).
        """
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
        """Stop the reader and close the port."""
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
        text = f"the DAQ on {self.port} was unplugged or switched off"
        return DeviceError(text, "Plug the DAQ in, then repeat the command")


class _TcpPort:
    """Port interface of SerialLink over TCP. pyserial's own socket:// returns one byte per call."""

    def __init__(self, host: str, number: int) -> None:
        self._socket = socket.create_connection((host, number), timeout=2.0)

    @property
    def in_waiting(self) -> int:
        """Number of bytes to request. TCP does not report how many there are."""
        return 65536 if select.select([self._socket], [], [], 0)[0] else 0

    def read(self, size: int) -> bytes:
        if not select.select([self._socket], [], [], 0.1)[0]:
            return b""
        data = self._socket.recv(size)
        if not data:
            raise ConnectionError("the other end closed the connection")
        return data

    def write(self, data: bytes) -> None:
        self._socket.sendall(data)

    def cancel_read(self) -> None:
        """Do nothing: `read` returns by itself within 0.1 s."""

    def close(self) -> None:
        self._socket.close()


def _open_port(port: str, baud_rate: int) -> Any:  # a pyserial port, which has no types, or a _TcpPort
    url = urlsplit(port)
    if url.scheme == "socket":
        if not url.hostname or not url.port:
            raise ValueError("the address must be socket://HOST:PORT")
        return _TcpPort(url.hostname, url.port)
    opened = serial.Serial(port, baud_rate, timeout=0.1, write_timeout=2.0, exclusive=True)
    if hasattr(opened, "set_buffer_size"):  # Windows only
        opened.set_buffer_size(rx_size=1 << 20)
    return opened
