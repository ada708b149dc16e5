"""What other threads ask of a live test."""

from __future__ import annotations

import threading


class TapStopped(Exception):  # noqa: N818  (no error: the operator wished it)
    """The operator ended the test before enough hits were good; they stay in the spool, the next test goes on."""


class Wishes:
    """Undo and stop, said by any thread and heard by that of the test."""

    def __init__(self) -> None:
        """Nothing is asked for."""
        self._undos, self._stopping = threading.Semaphore(0), threading.Event()

    def undo(self) -> None:
        """Take back the last good hit; again: the one before."""
        self._undos.release()

    def stop(self) -> None:
        """End the test."""
        self._stopping.set()

    @property
    def stopping(self) -> bool:
        """Whether the test is to end."""
        return self._stopping.is_set()

    def take_undo(self) -> bool:
        """Whether one more hit is to be taken back; each wish is told once."""
        return self._undos.acquire(blocking=False)
