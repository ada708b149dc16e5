"""How far a long piece of work is, on a terminal only."""

from __future__ import annotations

from types import TracebackType
from typing import Self

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from lobewatch.show.terminal.output import notes

WORDS = {"read": "reading", "store": "storing", "measure": "working out"}
"""What is told of the steps of a replay."""


class ProgressBar:
    """A bar a step; called with the step, how many are done, and of how many."""

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
            self._tasks[step] = self._bars.add_task(WORDS[step], total=of)
        self._bars.update(self._tasks[step], completed=done, total=of)  # type: ignore[arg-type]
