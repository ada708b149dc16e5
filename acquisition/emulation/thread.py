"""What every emulated device is: a thread that serves one end of a wire, whose other end opens like a real port."""

from __future__ import annotations

import os
import threading
from types import TracebackType
from typing import Self

from acquisition.emulation.wire import PtyWire, TcpWire, Wire


class EmulatorThread:
    """A context manager; while it lasts `serve_once` is called over and over."""

    def __init__(self, tcp: bool) -> None:
        """tcp listens on loopback instead of a pseudo-terminal."""
        self.wire: Wire = TcpWire() if tcp or os.name == "nt" else PtyWire()
        self.port = self.wire.port
        self._stopping = False
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._serve, name=type(self).__name__, daemon=True)

    def __enter__(self) -> Self:
        """Start serving."""
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Hang up."""
        self._stopping = True
        self._thread.join(timeout=5.0)
        self.wire.close()

    def wait(self) -> None:
        """Serve until interrupted or unplugged."""
        while not self._ended.wait(timeout=0.2):  # an interrupted Thread.join takes the thread for ended
            pass

    def serve_once(self) -> bool:
        """Answer what has come and send what is due; False to hang up."""
        raise NotImplementedError

    def _serve(self) -> None:
        try:
            while not self._stopping and self.serve_once():
                pass
            if not self._stopping:
                self.wire.close()
        finally:
            self._ended.set()
