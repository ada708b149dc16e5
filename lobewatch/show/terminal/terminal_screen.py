"""Show a tap test in a terminal: a screen that reads keys, or lines of text for logs and pipes."""

import contextlib
import math
import re
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any, Protocol, Self

from rich.align import Align
from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.markup import escape
from rich.panel import Panel
from rich.text import Text

from dsm import format_rounded
from lobewatch.show.terminal.option_names import with_option_names
from lobewatch.show.terminal.output import SafeConsole
from lobewatch.show.terminal.status_labels import status_name
from lobewatch.tap.state import ListedHit, Outcome, TapState, TapStep

POLL_INTERVAL = 0.05
"""Interval at which keys and test are polled (s)."""


class RunningTest(Protocol):
    """Live tap test, usable from any thread."""

    @property
    def state(self) -> TapState:
        """Newest state of the test."""
        ...

    def undo(self) -> None:
        """Undo the last good hit."""
        ...

    def decide(self, number: int | None, *, accept: bool) -> None:
        """Accept or reject a hit by its number, None for the last hit."""
        ...

    def stop(self) -> None:
        """End the test."""
        ...

    def choose(self, key: str, tool: str = "") -> None:
        """Choose what follows a test, by the key of one of the choices in its state."""
        ...


class TapPrinter:
    """Thread that prints a tap test within its context; the test never waits for it."""

    def __init__(self, session: RunningTest, console: Console) -> None:
        self._session, self._console = session, console
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._follow, name="tap printer", daemon=True)
        self._before = session.state
        self._n_printed = 0

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Print what is left."""
        self._ended.set()
        self._thread.join()

    def _follow(self) -> None:
        while not self._ended.wait(POLL_INTERVAL):
            self.print_new(self._session.state)
        self.print_new(self._session.state)

    def print_new(self, state: TapState) -> None:
        """Print what is new in a state."""
        before, self._before = self._before, state
        if state.title != before.title:
            self._n_printed = 0
        if state.device != before.device:
            self._console.print(f"{state.device}. Hit the tool with the hammer, again and again.", markup=False)
        for check in state.checks:
            if (check.is_notable or not check.passed) and check not in before.checks:
                symbol = "[bold green]✓[/]" if check.passed else "[bold yellow]![/]"
                self._console.print(f"{symbol} {escape(check.name)}: {escape(check.text)}")
        if state.resumed != before.resumed:
            self._console.print(state.resumed)
        with_hit = state.word in (TapStep.GOOD, TapStep.REFUSED) and not state.trial
        is_listed = with_hit or state.word is TapStep.FAILED or state.reason == before.reason
        if state.reason and not is_listed:
            self._console.print(escape(state.reason))
        self._print_hits(state)
        if state.hit_change and (before.hit_change is None or before.hit_change.code != state.hit_change.code):
            self._console.print(f"[bold yellow]![/] {escape(str(state.hit_change))}")

    def _print_hits(self, state: TapState) -> None:
        for hit in state.hits[self._n_printed :]:
            if not hit.earlier:
                good = sum(not earlier.flags for earlier in state.hits[: hit.number])
                self._console.print(f"{good:3d} / {state.wanted}  {hit_markup(hit)}  ({hit.peak})")
        self._n_printed = len(state.hits)


def hit_markup(hit: ListedHit) -> str:
    """Return symbol, words and remedy of a hit, with colors."""
    if hit.undone:
        return "[bold]↶ UNDONE[/]"
    if hit.accepted:
        return f"[bold green]✓ ACCEPTED[/]  {hit.accepted.words}"
    if not hit.flags:
        return "[bold green]✓ GOOD[/]"
    return f"[bold red]✗ {hit.flags.words.upper()}[/]  {escape(with_option_names(hit.reason))}"


PAGE_UP_CODES = re.compile(r"\x1b\[5~|[\xe0\0]I")
"""Page Up as terminals and Windows send it, by presenters and foot switches."""
SPECIAL_KEY_CODES = re.compile(r"\x1b(?:\[[0-?]*[ -/]*[@-~]|O.)|[\xe0\0].", re.DOTALL)
"""Codes of arrows and other special keys."""


class KeyReader:
    """Reader of single keys within its context; reads nothing if standard input is not a terminal."""

    def __init__(self) -> None:
        self._before: list[Any] | None = None

    def __enter__(self) -> Self:
        """Switch the terminal to single keys; Ctrl-C keeps its meaning."""
        if sys.platform != "win32" and sys.stdin.isatty():
            import termios
            import tty

            self._before = termios.tcgetattr(sys.stdin)
            tty.setcbreak(sys.stdin, termios.TCSADRAIN)
        return self

    def __exit__(self, *_: object) -> None:
        """Restore the terminal."""
        if sys.platform != "win32" and self._before is not None:
            import termios

            termios.tcsetattr(sys.stdin, termios.TCSADRAIN, self._before)
            self._before = None

    def read(self) -> str:
        """Read the waiting keys in lower case; empty if there are none."""
        if sys.platform == "win32":
            import msvcrt

            keys = ""
            while msvcrt.kbhit():
                keys += msvcrt.getwch()
            return normalize_keys(keys)
        if self._before is None:
            return ""
        import os
        import select

        ready = select.select([sys.stdin], [], [], 0)[0]
        return normalize_keys(os.read(sys.stdin.fileno(), 64).decode("ascii", "ignore")) if ready else ""


def normalize_keys(typed: str) -> str:
    """Return typed keys in lower case, Page Up as "u", without other special keys."""
    return SPECIAL_KEY_CODES.sub("", PAGE_UP_CODES.sub("u", typed)).lower()


MAX_SHOWN_HITS = 6
"""Largest number of newest hits that are listed."""
KEY_REPEAT_TIME = 0.7
"""Longest time between undo keys (s) that is one key held down, which counts once."""
STEP_STYLES: Mapping[TapStep, tuple[str, str]] = {
    TapStep.ASK: ("?", "black on #f0e442"),
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
"""Symbol and style of each step, distinct for color-blind people."""
BELL_COUNTS: Mapping[TapStep, int] = {TapStep.GOOD: 1, TapStep.REFUSED: 2, TapStep.NO_DEVICE: 3, TapStep.ASK: 1}
"""Number of bells of each step."""
STATUS_STYLES: Mapping[str, tuple[str, str]] = {
    "good": ("✓", "black on #2bb48d"),
    "warn": ("!", "black on #f0e442"),
    "alarm": ("✗", "black on #ee8238"),
    "unknown": ("?", "black on #dddddd"),
}
DECISION_KEYS: Mapping[str, bool] = {"a": True, "r": False}
"""Keys that accept (True) and reject the last hit, or the hit whose number was typed."""
MAX_NUMBER_DIGITS = 4
"""Largest number of digits of a typed hit number; chosen."""
CHOICE_KEYS: Mapping[str, str] = {"start": "y", "still": "s", "x": "x", "y": "y", "xy": "c", "tool": "n", "done": "q"}
"""Key of each choice."""


class TerminalScreen:
    """Thread that shows a tap test and reads keys within its context; the test never waits for it."""

    def __init__(self, session: RunningTest, console: Console | None = None) -> None:
        """Set the console, by default standard error."""
        self._session = session
        self._console = console = console or SafeConsole(stderr=True, highlight=False, emoji=False)
        self._muted = self._ahead_of_hit = False
        self._undo_at = -math.inf
        self._typed_number = ""
        self._keys = KeyReader()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="terminal screen", daemon=True)
        self._live = Live(
            console=self._console,
            get_renderable=lambda: render_state(session.state, self._muted, self._typed_number),
            refresh_per_second=10,
        )

    def __enter__(self) -> Self:
        """Show it, and listen to keys."""
        self._keys.__enter__()
        self._live.start()
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the last state on the screen, and restore the terminal."""
        self._ended.set()
        self._thread.join()
        self._live.stop()
        self._keys.__exit__()

    def _watch(self) -> None:
        before = self._session.state
        while not self._ended.wait(POLL_INTERVAL):
            for key in self._keys.read():
                self.handle_key(key)
            state = self._session.state
            self.ring_bells(before, state)
            before = state

    def handle_key(self, key: str) -> None:
        """Handle a key; before the test and while the sensor is moved, Enter and undo select the first choice."""
        state = self._session.state
        if state.choices and key != "m":
            self._handle_choice_key(state, key)
        elif key.isdecimal() and key.isascii():
            self._typed_number = f"{self._typed_number}{key}"[-MAX_NUMBER_DIGITS:]
        else:
            actions: dict[str, Callable[[], None]] = {"u": self._undo, "q": self._session.stop, "m": self._toggle_sound}
            actions |= {name: partial(self._decide, accept) for name, accept in DECISION_KEYS.items()}
            actions.get(key, lambda: None)()
            self._typed_number = ""

    def _handle_choice_key(self, state: TapState, key: str) -> None:
        if state.word in (TapStep.MOVE, TapStep.ASK) and key in "\nu":
            key = CHOICE_KEYS[state.choices[0].key]
        chosen = [choice.key for choice in state.choices if CHOICE_KEYS[choice.key] == key]
        if chosen:
            self._choose(chosen[0])
        elif key == "q":
            self._session.stop()

    def _undo(self) -> None:
        now = time.monotonic()
        if now - self._undo_at > KEY_REPEAT_TIME:
            self._session.undo()
        self._undo_at = now

    def _decide(self, accept: bool) -> None:
        self._session.decide(int(self._typed_number) if self._typed_number else None, accept=accept)

    def _toggle_sound(self) -> None:
        self._muted = not self._muted

    def _choose(self, key: str) -> None:
        """Pass a choice on, with the name of the next tool."""
        tool = self._ask_tool() if key == "tool" else ""
        with contextlib.suppress(ValueError):  # no name, or a page was quicker
            self._session.choose(key, tool)

    def _ask_tool(self) -> str:
        """Read a line while the screen is paused."""
        self._live.stop()
        self._keys.__exit__()
        self._console.print("\nNext tool, a name from machine.toml or a new name (Enter: no tool) > ", end="")
        try:
            return sys.stdin.readline().strip()
        finally:
            self._keys.__enter__()
            self._live.start()

    def ring_bells(self, before: TapState, state: TapState) -> None:
        """Ring the bells of a new step or hit once, even if the step of a hit arrives before the hit itself."""
        word, hit = state.word != before.word, len(state.hits) > len(before.hits)
        is_due = word or (hit and not self._ahead_of_hit)
        if word or hit:
            self._ahead_of_hit = not hit
        for _ in range(BELL_COUNTS.get(state.word, 0) if is_due and not self._muted else 0):
            self._console.bell()
            self._ended.wait(0.2)  # s, to tell bells apart


def render_state(state: TapState, muted: bool, typed_number: str = "") -> RenderableType:
    """Return one state of a test as it is shown; typed_number: number of a hit that was typed so far."""
    keys = [f"{CHOICE_KEYS[choice.key]} {choice.text}" for choice in state.choices] or ["u undo"]
    keys += ["q stop"] * (not state.choices or state.word is TapStep.ASK)
    keys.append(f"m {'sound' if muted else 'mute'}")
    if not state.choices:
        keys.append(f"a accept, r reject {f'hit {typed_number}' if typed_number else 'last hit, or NUMBER a'}")
    return Group(*_state_lines(state), Text("   ".join(keys), "bold"))


def _state_lines(state: TapState) -> Iterator[RenderableType]:
    yield Text(" - ".join(filter(None, (state.title, state.device))), "bold")
    if state.resumed:
        yield Text(with_option_names(state.resumed))
    symbol, style = STEP_STYLES[state.word]
    trial = " (trial hit)" if state.trial and state.word is TapStep.GOOD else ""
    banner = Text(f"{symbol}  {state.shown_word}{trial}   {state.good} / {state.wanted}", "bold")
    yield Panel(Align.center(banner), style=style, padding=(1, 1))
    yield Text(with_option_names(state.reason or str(state.hit_change or "")) or " ", "bold")
    if state.outcome is not None:
        yield from _outcome_lines(state.outcome)
        return
    yield Text(_level_line(state))
    for check in (check for check in state.checks if not (state.hits and check.passed)):
        yield Text(f"{'✓' if check.passed else '✗'} {check.name}: {with_option_names(check.text)}")
    for hit in state.hits[-MAX_SHOWN_HITS:]:
        yield Text.from_markup(f"{hit.number:3d}  {hit.peak:>8}  {hit_markup(hit)}")


def _outcome_lines(outcome: Outcome) -> Iterator[RenderableType]:
    """Return what was measured, the programs, and the status with the next step."""
    yield Text(with_option_names(" ".join(outcome.texts)))
    for program in outcome.programs:
        yield Text(f"  {program.program}: {program.word}")
    symbol, style = STATUS_STYLES[outcome.status]
    label = f" {symbol} {'EARLY ' if outcome.is_early else ''}{status_name(outcome.status).upper()} "
    yield Text.assemble((label, style), f"  next: {with_option_names(outcome.next_step)}")


def _level_line(state: TapState) -> str:
    """Return the levels of the sensors, and how far the mean has settled."""
    texts = []
    if state.levels is not None:
        force, response = (level and format_rounded(level, digits=2) for level in state.levels)
        texts.append(("" if force is None else f"force {force} N rms, ") + f"response {response} m/s^2 rms")
    if state.mean_change is not None:
        settled = " (converged)" if state.settled else ""
        texts.append(f"last good hit changed the mean by {100 * state.mean_change:.2g} %{settled}")
    return "   ".join(texts) or " "
