"""How far a replay or a rebuild is, on standard error."""

from __future__ import annotations

from collections.abc import Callable
from types import TracebackType
from typing import Self

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from lobewatch.show.terminal.output import notes

STEPS = {"read": "reading", "store": "storing", "measure": "working out"}
"""Names of the steps of a replay for people."""
EVERY = 10
"""Tap tests between two lines of a rebuild."""


class ReplayProgress:
    """A bar a step, on a terminal only; called with the step, how many files are done, and of how many."""

    def __init__(self) -> None:
        """Nothing is shown yet."""
        columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
        self._bars = Progress(*columns, console=notes, transient=True, disable=not notes.is_terminal)
        self._tasks: dict[str, int] = {}

    def __enter__(self) -> Self:
        """Begin to show."""
        self._bars.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Take the bars away."""
        self._bars.stop()

    def __call__(self, step: str, done: int, of: int) -> None:
        """So many are done."""
        if step not in self._tasks:
            self._tasks[step] = self._bars.add_task(STEPS[step], total=of)
        self._bars.update(self._tasks[step], completed=done, total=of)  # type: ignore[arg-type]


def rebuild_progress(name: str) -> Callable[[int, int], None]:
    """A line every few tap tests of the machine of this name; called with how many are done, and of how many."""

    def show(done: int, of: int) -> None:
        if done % EVERY == 0:
            notes.print(f"{name}: {done} of {of} tap tests", markup=False)

    return show
