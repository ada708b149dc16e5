"""A visit with tap tests that the dashboard has started, one a machine at a time."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace

from acquisition import DataError, TapDirection
from lobewatch.logbook import Logbook
from lobewatch.machine.folder import MachineFolder
from lobewatch.notify.telling import tell
from lobewatch.screen.return_memory import return_memory
from lobewatch.tap.hit_loop import TapStopped
from lobewatch.tap.session import TapSession, plan_session
from lobewatch.tap.state import TapState, TapStep
from lobewatch.tap.visit import TapVisit


class LiveTest:
    """A tap test, and those chosen after it, in a thread of its own from the beginning on."""

    def __init__(self, folder: MachineFolder, direction: TapDirection, *, resume: bool = True) -> None:
        """Begin, or go on with an interrupted test; DataError where machine.toml names no port."""
        if not folder.machine.daq.port:
            raise DataError(f"{folder.toml}: no port in [daq]; write port there, as lobewatch tap --port takes it")
        self._folder = folder
        self._resume = resume
        self._visit = TapVisit(self._plan, folder.machine.tap.tool, direction, after=self._tell)
        self._end: TapState | None = None
        self._thread = threading.Thread(target=self._run, name="tap test", daemon=True)
        self._thread.start()

    @property
    def state(self) -> TapState:
        """Newest state of the test, also after its end."""
        return self._end or self._visit.state

    @property
    def wakes(self) -> set[Callable[[], None]]:
        """Functions that are called after every change but that of the end by `stop`."""
        return self._visit.wakes

    @property
    def running(self) -> bool:
        """Whether it holds the device; where it has failed it gives it back."""
        return self._thread.is_alive() and not self._visit.waits and self.state.word is not TapStep.FAILED

    def undo(self) -> None:
        """Take the last good hit back."""
        self._visit.undo()

    def stop(self) -> None:
        """End it; the hits so far stay in the spool."""
        self._visit.stop()

    def choose(self, key: str, tool: str = "") -> None:
        """Say what comes after a test."""
        self._visit.choose(key, tool)

    def join(self) -> None:
        """Wait until it has given the device back."""
        self._thread.join()

    def _plan(self, tool: str, direction: TapDirection) -> TapSession:
        return plan_session(MachineFolder(self._folder.path), tool=tool, direction=direction, resume=self._resume)

    def _tell(self, *_: object) -> None:
        tell(Logbook.open(self._folder.path))

    def _run(self) -> None:
        try:
            self._visit.run()
        except TapStopped:
            state = self._visit.state
            reason = f"Stopped with {state.good} good hits: START goes on with them."
            self._end = replace(state, word=TapStep.FAILED, reason=reason)
        except (OSError, RuntimeError, ValueError):
            pass  # the session shows its failure itself
        finally:
            return_memory()
