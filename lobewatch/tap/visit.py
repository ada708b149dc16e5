"""Visit to a machine: tap tests in x, in y, then as the operator chooses."""

import queue
from collections.abc import Callable, Sequence
from dataclasses import replace

from acquisition import TapDirection, parse_direction
from lobewatch.machine.folder import MachineFolder
from lobewatch.tap.session import TapSession
from lobewatch.tap.spool import count_interrupted_hits
from lobewatch.tap.state import Choice, TapState, TapStep

CROSS_TAP_CHOICE = Choice("xy", "tap xy (hit in x, sensor in y)")
NEXT_TOOL_CHOICE, DONE_CHOICE = Choice("tool", "next tool"), Choice("done", "done")
DIRECTION_CHOICES: dict[TapDirection, Choice] = {"x": Choice("x", "tap x"), "y": Choice("y", "tap y")}


def choose_first_direction(folder: MachineFolder, tool: str) -> TapDirection:
    """Return the direction to begin with: x, but y if only a test in y was interrupted."""
    interrupted = count_interrupted_hits(folder) if tool == folder.machine.tap.tool else {}
    return "y" if interrupted.keys() == {"y"} else "x"


class TapVisit:
    """Sequence of tap tests. `run` is for one thread, all else for every thread."""

    def __init__(
        self,
        plan: Callable[[str, TapDirection], TapSession],
        tool: str,
        direction: TapDirection = "x",
        *,
        leads: bool = True,
        after: Callable[[TapSession], None],
    ) -> None:
        """Plan the first test.

        plan: makes a test of a tool in a direction. leads: False for one test in `direction` only. after: called with
        each finished test.
        """
        self._plan, self._after, self._leads = plan, after, leads
        self._tool, self._direction = tool, direction
        self._session = plan(tool, direction)
        self._pause: TapState | None = None
        self._answers = queue.SimpleQueue[tuple[str, str]]()
        self.wakes: set[Callable[[], None]] = set()
        """Functions called after every change by the thread of the test. None may take time."""

    @property
    def state(self) -> TapState:
        """Newest state, between two tests with the choices."""
        return self._pause or self._session.state

    @property
    def is_waiting(self) -> bool:
        """True if no test runs and a choice is awaited."""
        return self._pause is not None and bool(self._pause.choices)

    def undo(self) -> None:
        """Take back the last good hit. Again: the one before."""
        if not self.is_waiting:
            self._session.undo()

    def decide(self, number: int | None, *, accept: bool) -> None:
        """Accept or reject a hit by its number, None for the last hit."""
        if not self.is_waiting:
            self._session.decide(number, accept=accept)

    def stop(self) -> None:
        """End the running test, or the visit between two tests."""
        self._answers.put((DONE_CHOICE.key, ""))
        self._session.stop()

    def choose(self, key: str, tool: str = "") -> None:
        """Choose what comes next by the key of a choice. tool: name of the next one. ValueError if not possible."""
        if not self.is_waiting:
            self._session.choose(key, tool)
            return
        if key not in [choice.key for choice in self.state.choices]:
            raise ValueError(f"{key!r} is not available now. Use a choice that the page shows.")
        if key == NEXT_TOOL_CHOICE.key and not tool.strip():
            raise ValueError("the next tool has no name. Enter a tool name of machine.toml or a new name.")
        self._answers.put((key, tool.strip()))

    def run(self) -> None:
        """Tap until the operator is done. Raises what `TapSession.run` raises."""
        tapped = set[TapDirection]()
        confirmed = set[str]()
        while True:
            self._session.questions.is_confirmed |= self._tool in confirmed
            self._session.wakes.add(self._wake)
            self._session.run()
            confirmed.add(self._tool)
            tapped.add(self._direction)
            self._after(self._session)
            if not self._leads:
                return
            key, tool = self._wait(tapped)
            if key == DONE_CHOICE.key:
                self._show(None)
                return
            if key == NEXT_TOOL_CHOICE.key:
                self._tool, tapped = tool, set()
            self._direction = "x" if key == NEXT_TOOL_CHOICE.key else parse_direction(key)
            self._session = self._plan(self._tool, self._direction)
            self._show(None)

    def _wait(self, tapped: set[TapDirection]) -> tuple[str, str]:
        """Show the result, or that the sensor must be moved first, and wait for a choice."""
        state, cross_tap = self._session.state, self._session.across
        missing = next((direction for direction in DIRECTION_CHOICES if direction not in tapped), None)
        if missing is not None:
            tap = DIRECTION_CHOICES[missing]
            turn = "Turn hammer and sensor to"
            turn = f"{cross_tap.text} Leave the sensor in place. Turn the hammer to" if cross_tap else turn
            reason = f'Direction {self._direction} is saved. {turn} {missing}, then choose "{tap.text}".'
            choices: Sequence[Choice] = (tap, DONE_CHOICE)
            state = replace(state, word=TapStep.MOVE, direction=missing, reason=reason, outcome=None)
            state = replace(state, sensor_stays=cross_tap is not None)
        else:
            across = (CROSS_TAP_CHOICE,) if state.outcome is not None and state.outcome.needs_cross_tap else ()
            choices = (*DIRECTION_CHOICES.values(), *across, NEXT_TOOL_CHOICE, DONE_CHOICE)
        self._show(replace(state, revision=state.revision + 1, choices=tuple(choices)))
        return self._answers.get()

    def _show(self, pause: TapState | None) -> None:
        self._pause = pause
        self._wake()

    def _wake(self) -> None:
        for wake in tuple(self.wakes):
            wake()
