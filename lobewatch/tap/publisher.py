"""The one place that makes the pictures of a live test, and of a cut that is listened to."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, ClassVar, Generic, Protocol, TypeVar

from lobewatch.tap.judged_hits import JudgedHits
from lobewatch.tap.state import TapState


class LivePicture(Protocol):
    """Picture of a live test: a frozen dataclass."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def revision(self) -> int:
        """Number that rises with every change."""


State = TypeVar("State", bound=LivePicture)


class Pictures(Generic[State]):
    """The newest picture: only replaced, never changed, by the thread of the test; any thread may read it."""

    def __init__(self, first: State, clock: Callable[[], float]) -> None:
        """clock: seconds that never go back."""
        self._state: State = first
        self._clock, self._shown_at = clock, clock()
        self.wakes: set[Callable[[], None]] = set()
        """Functions that are called after every change, by the thread that has made it; none may take time."""

    @property
    def state(self) -> State:
        """The newest picture."""
        return self._state

    @property
    def age(self) -> float:
        """Time for which it has stood (s)."""
        return self._clock() - self._shown_at

    def show(self, **changes: Any) -> None:
        """Replace the picture by one with these fields of it."""
        self._state = replace(self._state, revision=self._state.revision + 1, **changes)
        self._shown_at = self._clock()
        for wake in tuple(self.wakes):
            wake()


class Publisher(Pictures[TapState]):
    """The pictures of a test."""

    def show_hits(self, hits: JudgedHits, **changes: Any) -> None:
        """The list of hits, what follows from it, and other fields with it."""
        mean = hits.mean
        self.show(hits=hits.tap.taken, good=hits.tap.good, mean_change=mean.change, settled=mean.settled, **changes)
