"""Building blocks of an emulated device: signal function, wire and server thread."""

import contextlib
import os
import select
import socket
import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np

from acquisition.arrays import Codes, Floats
from acquisition.channel import Block, Channel, SensorInput
from acquisition.errors import DataError
from acquisition.source import ClosedOnExit, DeviceIdentity, Event

SignalFunction = Callable[[int, int], Floats]
"""Function (first_scan, n_scans) that returns values in N and m/s^2, shape (n_channels, n_scans)."""


def quantise(signal: Floats, channels: tuple[Channel, ...]) -> Codes:
    """Convert values to ADC codes.

    Parameters
    ----------
    signal : ndarray, shape (n_channels, n)
        Values in N and m/s^2.
    channels
        Channel of each row.

    Returns
    -------
    ndarray, shape (n_channels, n)
        ADC codes.
    """
    return np.stack([channel.encode(values) for channel, values in zip(channels, signal, strict=True)])


class SimulatedSource(ClosedOnExit):
    """Source of the scans of a signal function, as fast as they are read. For unit tests.

    Parameters
    ----------
    signal
        Function (first_scan, n_scans) that returns values in N and m/s^2, shape (n_channels, n_scans).
    channels
        Channels of the source.
    sample_rate
        Sample rate (Hz).
    n_scans
        Length of the stream (scans).
    block
        Length of a block (scans).

    Examples
    --------
    >>> sensors = (Channel("force", 2.25e-3, 5.0),)
    >>> quiet = SimulatedSource(lambda first, n: np.zeros((1, n)), sensors, 10240.0, n_scans=1000)
    >>> [block.codes.shape for block in quiet.blocks()]  # channels, scans
    [(1, 512), (1, 512)]
    """

    identity = DeviceIdentity("simulation")
    """Identity that it reports."""
    follows_clock = False
    """False, as scans come as fast as they are read."""
    loss_detection = ""
    """Empty: no scans can be lost."""

    def __init__(
        self, signal: SignalFunction, channels: tuple[Channel, ...], sample_rate: float, n_scans: int, block: int = 512
    ) -> None:
        self.channels = channels
        """Channel of each input."""
        self.sample_rate = sample_rate
        """Sample rate (Hz)."""
        self.events: deque[Event] = deque()
        """Events, to be added by the test."""
        self._signal, self._n_scans, self._block = signal, n_scans, block

    @property
    def fault(self) -> str:
        """Empty: the source has no faults."""
        return ""

    def start(self) -> None:
        """Start: nothing to prepare."""

    def stop(self) -> None:
        """End at the next block."""
        self._n_scans = 0

    def close(self) -> None:
        self.stop()

    def blocks(self) -> Iterator[Block]:
        """Yield the signal in blocks, without gaps."""
        first = 0
        while first < self._n_scans:
            yield Block(first, quantise(self._signal(first, self._block), self.channels))
            first += self._block


@dataclass(frozen=True)
class EmulationSetup:
    """Signals of an emulated device and the way it is served."""

    signal_at: Callable[[float], SignalFunction]
    """Function that returns, for a sample rate (Hz), the signal function of the sensors."""
    inputs: tuple[SensorInput, ...]
    """Sensors, in the order of the signal's rows."""
    sample_rate: float
    """Sample rate of a device that has only one (Hz)."""
    realtime: bool = True
    """True if it sends by the clock. False sends as fast as the host reads."""
    tcp: bool = False
    """True if it serves a TCP port of this computer instead of a pseudo-terminal."""
    digital_clock: bool = False
    """True if a square wave is on digital input 0."""
    clock_error: float = 0.0
    """Relative error of its sample clock, of which it does not know."""

    def clock(self) -> float:
        """Return the time (s) by the clock of the device."""
        return (1 + self.clock_error) * time.monotonic()


class PtyWire:
    """Pseudo-terminal in raw mode.

    The host's end stays open here too, so that a host may come and go.

    Parameters
    ----------
    link
        Path that is made to lead to the pseudo-terminal.

    Raises
    ------
    DataError
        The system has no pseudo-terminal.
    """

    def __init__(self, link: Path | None = None) -> None:
        import pty
        import tty

        try:
            self._master, self._slave = pty.openpty()
        except OSError as error:
            text = f"this system has no pseudo-terminal ({error}). Emulate the device on TCP with EmulationSetup.tcp."
            raise DataError(text) from error
        self._open = [self._slave, self._master]
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.port = os.ttyname(self._slave)
        """Port that the host opens."""
        self.pending = bytearray()
        """Bytes waiting to be sent."""
        if link is not None:
            link.unlink(missing_ok=True)
            link.symlink_to(self.port)

    def exchange(self, timeout: float) -> bytes:
        """Send what fits of `pending` and return what has arrived.

        Parameters
        ----------
        timeout
            Longest time to wait (s).
        """
        sending = [self._master] if self.pending else []
        readable, writable, _ = select.select([self._master], sending, [], timeout)
        with contextlib.suppress(BlockingIOError):  # the host may flush between select and here
            if writable:
                del self.pending[: os.write(self._master, memoryview(self.pending)[:65536].tobytes())]
            if readable:
                return os.read(self._master, 65536)
        return b""

    def close(self) -> None:
        while self._open:  # each once: the numbers of closed files are given to others
            os.close(self._open.pop())


class TcpWire:
    """Listening socket for one host at a time.

    Parameters
    ----------
    number
        TCP port number, 0 for a free one.
    address
        Address of this computer to listen at.
    """

    def __init__(self, number: int = 0, address: str = "127.0.0.1") -> None:
        family = socket.AF_INET6 if ":" in address else socket.AF_INET
        self._listener = socket.create_server((address, number), family=family)
        self._host: socket.socket | None = None
        self.host_address = ""
        """Address and TCP port of the newest host."""
        host = f"[{address}]" if ":" in address else address
        self.port = f"socket://{host}:{self._listener.getsockname()[1]}"
        """Port that the host opens."""
        self.pending = bytearray()
        """Bytes waiting to be sent."""

    @property
    def has_host(self) -> bool:
        """True if a host is connected."""
        return self._host is not None

    def exchange(self, timeout: float) -> bytes:
        """Send what fits of `pending` and return what has arrived.

        Parameters
        ----------
        timeout
            Longest time to wait (s).
        """
        if self._host is None:
            return self._accept(timeout)
        sending = [self._host] if self.pending else []
        readable, writable, _ = select.select([self._host], sending, [], timeout)
        try:
            if writable:
                del self.pending[: self._host.send(memoryview(self.pending)[:65536].tobytes())]
            data = self._host.recv(65536) if readable else None
        except BlockingIOError:
            data = None
        except OSError:
            data = b""
        if data == b"":
            self.hang_up()
        return data or b""

    def close(self) -> None:
        self.hang_up()
        self._listener.close()

    def _accept(self, timeout: float) -> bytes:
        self.pending.clear()
        if select.select([self._listener], [], [], timeout)[0]:
            with contextlib.suppress(OSError):  # the host may be gone again
                self._host, (address, number, *_) = self._listener.accept()
                self._host.setblocking(False)
                self.host_address = f"{address}:{number}"
        return b""

    def hang_up(self) -> None:
        """Disconnect the host."""
        if self._host is not None:
            self._host.close()
            self._host = None


Wire = PtyWire | TcpWire
"""Emulator's end of the cable, without blocking."""


class EmulatorThread(ABC):
    """Thread that serves one end of a wire, whose other end opens like a real port. A context manager.

    Parameters
    ----------
    tcp
        Whether to listen on loopback instead of a pseudo-terminal.
    link
        Path that always leads to the pseudo-terminal.
    """

    def __init__(self, tcp: bool, link: Path | None = None) -> None:
        self._tcp, self._link = tcp or os.name == "nt", link
        self.port = ""
        """Port that the host opens."""
        self.plug_in()

    def __enter__(self) -> Self:
        """Start serving."""
        self.serve()
        return self

    def __exit__(self, *_: object) -> None:
        self.unplug()

    def plug_in(self) -> None:
        """Make a wire that nothing serves yet. With TCP it keeps the port of an earlier one."""
        self.wire: Wire = TcpWire(int(self.port.rpartition(":")[2] or 0)) if self._tcp else PtyWire(self._link)
        self.port = self.wire.port
        self._stopping = False
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._serve, name=type(self).__name__, daemon=True)

    def serve(self) -> None:
        """Start to answer."""
        self._thread.start()

    def unplug(self) -> None:
        """Pull the cable: the host's port fails."""
        self._stopping = True
        self._thread.join(timeout=5.0)
        self.wire.close()

    def wait(self) -> None:
        """Serve until interrupted or unplugged."""
        while not self._ended.wait(timeout=0.2):  # an interrupted Thread.join takes the thread for ended
            pass

    @abstractmethod
    def serve_once(self) -> bool:
        """Answer what has arrived and send what is due. Return False to hang up."""

    def _serve(self) -> None:
        try:
            while not self._stopping and self.serve_once():
                pass
            if not self._stopping:
                self.wire.close()
        finally:
            self._ended.set()
