"""The emulator's end of the cable: a pseudo-terminal or a TCP port on loopback, both without blocking."""

from __future__ import annotations

import contextlib
import os
import select
import socket
from pathlib import Path
from typing import Protocol

from acquisition.errors import DataError


class Wire(Protocol):
    """Bytes both ways."""

    port: str
    """Port that the host opens."""
    pending: bytearray
    """Bytes that wait to be sent."""

    def exchange(self, timeout: float) -> bytes:
        """Send what fits of `pending` and return what has come, after at most timeout (s)."""
        ...

    def close(self) -> None:
        """Hang up."""
        ...


class PtyWire:
    """A pseudo-terminal in raw mode."""

    def __init__(self, link: Path | None = None) -> None:
        """Open it, and make link lead to it; the host's end stays open here too, so that a host may come and go.

        DataError where there is none.
        """
        import pty
        import tty

        try:
            self._master, self._slave = pty.openpty()
        except OSError as error:
            raise DataError(f"no pseudo-terminal can be had here ({error}); go through TCP, with --tcp") from error
        self._open = [self._slave, self._master]
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.port = os.ttyname(self._slave)
        self.pending = bytearray()
        if link is not None:
            link.unlink(missing_ok=True)
            link.symlink_to(self.port)

    def exchange(self, timeout: float) -> bytes:
        """See Wire."""
        sending = [self._master] if self.pending else []
        readable, writable, _ = select.select([self._master], sending, [], timeout)
        with contextlib.suppress(BlockingIOError):  # the host may flush between select and here
            if writable:
                del self.pending[: os.write(self._master, memoryview(self.pending)[:65536].tobytes())]
            if readable:
                return os.read(self._master, 65536)
        return b""

    def close(self) -> None:
        """See Wire."""
        while self._open:  # each once: the numbers of closed files are given to others
            os.close(self._open.pop())


class TcpWire:
    """A listening socket; one host at a time."""

    def __init__(self, number: int = 0, address: str = "127.0.0.1") -> None:
        """Listen on this port, 0 for a free one, at an address of this computer."""
        family = socket.AF_INET6 if ":" in address else socket.AF_INET
        self._listener = socket.create_server((address, number), family=family)
        self._host: socket.socket | None = None
        host = f"[{address}]" if ":" in address else address
        self.port = f"socket://{host}:{self._listener.getsockname()[1]}"
        self.pending = bytearray()

    @property
    def has_host(self) -> bool:
        """Whether one is connected."""
        return self._host is not None

    def exchange(self, timeout: float) -> bytes:
        """See Wire."""
        if self._host is None:
            return self._accept(timeout)
        sending = [self._host] if self.pending else []
        readable, writable, _ = select.select([self._host], sending, [], timeout)
        try:
            if writable:
                del self.pending[: self._host.send(memoryview(self.pending)[:65536].tobytes())]
            data = self._host.recv(65536) if readable else None
        except ConnectionError:
            data = b""
        if data == b"":
            self._hang_up()
        return data or b""

    def close(self) -> None:
        """See Wire."""
        self._hang_up()
        self._listener.close()

    def _accept(self, timeout: float) -> bytes:
        self.pending.clear()
        if select.select([self._listener], [], [], timeout)[0]:
            self._host = self._listener.accept()[0]
            self._host.setblocking(False)
        return b""

    def _hang_up(self) -> None:
        if self._host is not None:
            self._host.close()
            self._host = None
