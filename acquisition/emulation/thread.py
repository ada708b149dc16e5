"""What every emulated device is: a thread that serves one end of a wire, whose other end opens like a real port."""

from __future__ import annotations

import os
import threading
from abc import ABC, abstractmethod
from pathlib import Path
from types import TracebackType
from typing import Self

from acquisition.emulation.wire import PtyWire, TcpWire, Wire


class EmulatorThread(ABC):
    """A context manager; while it lasts `serve_once` is called over and over."""

    def __init__(self, tcp: bool, link: Path | None = None) -> None:
        """tcp listens on loopback instead of a pseudo-terminal; link: a name that always leads to that."""
        self._tcp, self._link = tcp or os.name == "nt", link
        self.port = ""
        """What the host opens."""
        self.plug_in()

    def __enter__(self) -> Self:
        """Start serving."""
        self.serve()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Hang up."""
        self.unplug()

    def plug_in(self) -> None:
        """A new wire that nobody serves yet: with tcp on the same port as before, if there was one."""
        self.wire: Wire = TcpWire(int(self.port.rpartition(":")[2] or 0)) if self._tcp else PtyWire(self._link)
        self.port = self.wire.port
        self._stopping = False
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._serve, name=type(self).__name__, daemon=True)

    def serve(self) -> None:
        """Start the thread."""
        self._thread.start()

    def unplug(self) -> None:
        """Pull the cable: the host's port fails, whatever it was doing."""
        self._stopping = True
        self._thread.join(timeout=5.0)
        self.wire.close()

    def wait(self) -> None:
        """Serve until interrupted or unplugged."""
        while not self._ended.wait(timeout=0.2):  # an interrupted Thread.join takes the thread for ended
            pass

    @abstractmethod
    def serve_once(self) -> bool:
        """Answer what has come and send what is due; False to hang up."""

    def _serve(self) -> None:
        try:
            while not self._stopping and self.serve_once():
                pass
            if not self._stopping:
                self.wire.close()
        finally:
            self._ended.set()
