"""The operator's screen in a terminal, for SSH: the words and keys of the browser's."""

from __future__ import annotations

import contextlib
import math
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from types import TracebackType
from typing import Self

from rich.align import Align
from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.panel import Panel
from rich.text import Text

from dsm import rounded
from lobewatch.show.terminal.keys import Keys
from lobewatch.show.terminal.output import Terminal
from lobewatch.show.terminal.printer import RunningTest, verdict_markup
from lobewatch.tap.state import Outcome, TapState, TapStep

INTERVAL = 0.05
"""Between two looks at keys and state (s)."""
SHOWN_HITS = 6
"""Newest hits that are listed."""
BELL_PAUSE = 0.2
"""Between two bells (s)."""
HELD_TIME = 0.7
"""Undo keys that follow each other faster (s) are one that is held down: it counts once."""
LOOKS: Mapping[TapStep, tuple[str, str]] = {
    TapStep.CHECKING: ("…", "black on #56b4e9"),
    TapStep.TAP: ("▼", "black on #56b4e9"),
    TapStep.WAIT: ("…", "black on #e69f00"),
    TapStep.GOOD: ("✓", "black on #2bb48d"),
    TapStep.REFUSED: ("✗", "black on #ee8238"),
    TapStep.NO_DEVICE: ("!", "black on #f0e442"),
    TapStep.MOVE: ("⟳", "black on #f0e442"),
    TapStep.DONE: ("■", "black on #2bb48d"),
    TapStep.FAILED: ("✗", "black on #ee8238"),
}
"""Symbol and colours of each word, told apart by colour-blind people too."""
BELLS: Mapping[TapStep, int] = {TapStep.GOOD: 1, TapStep.REFUSED: 2, TapStep.NO_DEVICE: 3}
"""Number of bells."""
LIGHTS: Mapping[str, tuple[str, str]] = {
    "good": ("✓", "black on #2bb48d"),
    "warn": ("!", "black on #f0e442"),
    "alarm": ("✗", "black on #ee8238"),
    "unknown": ("?", "black on #dddddd"),
}
CHOICE_KEYS: Mapping[str, str] = {"x": "x", "y": "y", "xy": "c", "tool": "n", "done": "q"}
"""Key that stands for each choice."""


class TerminalScreen:
    """Shows a test between __enter__ and __exit__ and hands its keys on; the test never waits for it."""

    def __init__(self, session: RunningTest, console: Console | None = None) -> None:
        """Nothing is shown yet; console None: standard error."""
        self._session = session
        self._console = console or Terminal(stderr=True, highlight=False, emoji=False)
        self._muted = self._ahead_of_hit = False
        self._undo_at = -math.inf
        self._keys = Keys()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="terminal screen", daemon=True)
        self._live = Live(console=self._console, get_renderable=self._picture, refresh_per_second=10)

    def __enter__(self) -> Self:
        """Show it, and listen to keys."""
        self._keys.__enter__()
        self._live.start()
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Leave the last picture; the terminal as it was."""
        self._ended.set()
        self._thread.join()
        self._live.stop()
        self._keys.__exit__(kind, error, trace)

    def _watch(self) -> None:
        """Keys and bells."""
        before = self._session.state
        while not self._ended.wait(INTERVAL):
            for key in self._keys.pressed():
                self.press(key)
            state = self._session.state
            self.ring(before, state)
            before = state

    def press(self, key: str) -> None:
        """Do what a key stands for; while the sensor is moved, Enter and undo stand for the first choice."""
        state = self._session.state
        if state.choices and key != "m":
            if state.word is TapStep.MOVE and key in "\nu":
                key = CHOICE_KEYS[state.choices[0].key]
            chosen = [choice.key for choice in state.choices if CHOICE_KEYS[choice.key] == key]
            if chosen:
                self._choose(chosen[0])
        elif key == "u":
            now = time.monotonic()
            if now - self._undo_at > HELD_TIME:
                self._session.undo()
            self._undo_at = now
        elif key == "q":
            self._session.stop()
        elif key == "m":
            self._muted = not self._muted

    def _choose(self, key: str) -> None:
        """Hand a choice on, with the name of the next tool."""
        tool = self._ask_tool() if key == "tool" else ""
        with contextlib.suppress(ValueError):  # no name, or a page was quicker
            self._session.choose(key, tool)

    def _ask_tool(self) -> str:
        """A line that is typed, the screen standing still meanwhile."""
        self._live.stop()
        self._keys.__exit__(None, None, None)
        self._console.print("\nnext tool, by its name in machine.toml or a new one (Enter: none) > ", end="")
        try:
            return sys.stdin.readline().strip()
        finally:
            self._keys.__enter__()
            self._live.start()

    def ring(self, before: TapState, state: TapState) -> None:
        """The bells of a new word or hit; a verdict's word may come a picture ahead of its hit, and then rings once."""
        word, hit = state.word != before.word, len(state.hits) > len(before.hits)
        is_due = word or (hit and not self._ahead_of_hit)
        if word or hit:
            self._ahead_of_hit = not hit
        for _ in range(BELLS.get(state.word, 0) if is_due and not self._muted else 0):
            self._console.bell()
            self._ended.wait(BELL_PAUSE)

    def _picture(self) -> RenderableType:
        return picture(self._session.state, self._muted)


def picture(state: TapState, muted: bool) -> RenderableType:
    """One state of a test, as it stands on the terminal."""
    keys = [f"{CHOICE_KEYS[choice.key]} {choice.text}" for choice in state.choices] or ["u undo", "q stop"]
    return Group(*_lines(state), Text("   ".join([*keys, f"m {'sound' if muted else 'mute'}"]), "bold"))


def _lines(state: TapState) -> Iterator[RenderableType]:
    yield Text(" - ".join(filter(None, (state.title, state.device))), "bold")
    if state.resumed:
        yield Text(state.resumed)
    yield _banner(state)
    yield Text(state.reason or " ", "bold")
    if state.outcome is not None:
        yield from _outcome_lines(state.outcome)
        return
    yield Text(_numbers(state))
    for check in (check for check in state.checks if not (state.hits and check.passed)):
        yield Text(f"{'✓' if check.passed else '✗'} {check.name}: {check.text}")
    for hit in state.hits[-SHOWN_HITS:]:
        yield Text.from_markup(f"{hit.number:3d}  {hit.peak:>8}  {verdict_markup(hit)}")


def _outcome_lines(outcome: Outcome) -> Iterator[RenderableType]:
    """What was measured, the programs, and last the light with the next step."""
    yield Text(" ".join(outcome.texts))
    for program in outcome.programs:
        yield Text(f"  {program.program}: {program.word}")
    symbol, style = LIGHTS[outcome.light]
    early = "EARLY " if outcome.is_early else ""
    yield Text.assemble((f" {symbol} {early}{outcome.light.upper()} ", style), f"  next: {outcome.next_step}")


def _banner(state: TapState) -> RenderableType:
    """The full-width word."""
    symbol, style = LOOKS[state.word]
    trial = " (trial hit)" if state.trial and state.word is TapStep.GOOD else ""
    text = Text(f"{symbol}  {state.shown_word}{trial}   {state.good} / {state.wanted}", "bold")
    return Panel(Align.center(text), style=style, padding=(1, 1))


def _levels(force: float, response: float) -> str:
    return f"force {rounded(force, digits=2)} N rms, {_response(response)}"


def _response(response: float) -> str:
    return f"response {rounded(response, digits=2)} m/s^2 rms"


def _numbers(state: TapState) -> str:
    """Levels, and how far the mean has come."""
    texts = []
    if state.levels is not None:
        force, response = state.levels
        texts.append(_response(response) if force is None else _levels(force, response))
    if state.mean_change is not None:
        moves = f"the last good hit moved the mean by {100 * state.mean_change:.2g} %"
        texts.append(f"{moves}; it has settled" if state.settled else moves)
    return "   ".join(texts) or " "
