"""A live tap test from the self-check to the result: one thread runs it, any thread may look and take a hit back."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol

from acquisition import Circumstances, Source, TapTest
from lobewatch.machine_folder import MachineFolder
from lobewatch.pipeline import Measurement
from lobewatch.tap_state import TapState, Word


class Device(Source, Protocol):
    """A connected source that can be given back."""

    def close(self) -> None:
        """Stop, and give the port back."""
        ...


class TapStopped(Exception):
    """The operator ended the test before enough hits were good; they stay in the spool, the next test goes on."""


class TapSession:
    """One tap test of one machine: `run` it in one thread; `state`, `undo` and `stop` are for every thread."""

    def __init__(
        self,
        folder: MachineFolder,
        open_device: Callable[[], Device],
        circumstances: Circumstances,
        *,
        resume: bool = True,
        guided: bool = True,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Nothing is opened yet. guided False leaves out what only a person needs: self-check, re-arming by decay, and
        the time to take back the last hit."""
        self._state = TapState(0, Word.CHECKING, "")

    @property
    def state(self) -> TapState:
        """The newest picture of the test; never changed, only replaced."""
        return self._state

    @property
    def measurement(self) -> Measurement:
        """What the finished test says of the spindle; ValueError before the end."""
        raise NotImplementedError

    def undo(self) -> None:
        """Take back the last good hit; again: the one before."""
        raise NotImplementedError

    def stop(self) -> None:
        """End the test now; `run` raises TapStopped, the hits so far stay in the spool."""
        raise NotImplementedError

    def run(self) -> TapTest:
        """Take hits until enough are good, commit the test and return it; blocks.

        Raises DeviceError where there is no device at the start (later it is waited for), DataError where another
        program writes to the folder or the disk is full, ValueError where the interrupted test was recorded with
        another set-up, TapStopped after stop().
        """
        raise NotImplementedError
