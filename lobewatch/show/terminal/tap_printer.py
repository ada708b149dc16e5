"""Print a tap test as lines of text, for logs and pipes."""

from __future__ import annotations

import threading
from typing import Protocol, Self

from rich.console import Console
from rich.markup import escape

from lobewatch.show.terminal.option_names import with_option_names
from lobewatch.tap.state import ListedHit, TapState, TapStep

PRINT_INTERVAL = 0.05
"""Time between two looks at the test (s)."""


class RunningTest(Protocol):
    """Live tap test, usable from any thread."""

    @property
    def state(self) -> TapState:
        """Newest state of the test."""
        ...

    def undo(self) -> None:
        """Undo the last good hit."""
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
        while not self._ended.wait(PRINT_INTERVAL):
            self.print_new(self._session.state)
        self.print_new(self._session.state)

    def print_new(self, state: TapState) -> None:
        """Print what is new in a state."""
        before, self._before = self._before, state
        if state.title != before.title:
            self._n_printed = 0
        if state.device != before.device:
            self._console.print(f"{state.device}. TAP the tool, again and again.", markup=False)
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

    def _print_hits(self, state: TapState) -> None:
        for hit in state.hits[self._n_printed :]:
            if hit.earlier:
                continue
            good = sum(not earlier.flags for earlier in state.hits[: hit.number])
            self._console.print(f"{good:3d} / {state.wanted}  {hit_markup(hit)}  ({hit.peak})")
        self._n_printed = len(state.hits)


def hit_markup(hit: ListedHit) -> str:
    """Return symbol, words and remedy of a hit, with colors."""
    if hit.undone:
        return "[bold]↶ UNDONE[/]"
    if not hit.flags:
        return "[bold green]✓ GOOD[/]"
    return f"[bold red]✗ {hit.flags.words.upper()}[/]  {escape(with_option_names(hit.reason))}"
