"""Tap tests in order of time, each with those before it that it builds on."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from datetime import datetime

import msgspec

from acquisition import Remark
from lobewatch.machine import TapEntry
from lobewatch.tool.mountings import Mountings


class Place(msgspec.Struct, frozen=True, gc=False):
    """One tap test among all of a machine."""

    number: int
    """From 0, the oldest."""
    entry: TapEntry
    """Of the journal."""
    before: int | None
    """Place of the one before it of the same series and direction."""
    other: int | None
    """Place of the newest one before it of the same series in another direction."""
    baseline: datetime | None = None
    """The event before it from which on all comparing begins anew; nothing before that is built on."""
    series: str = ""
    """Its first tap test: of one tool with one stick-out in one state, both directions, since the baseline."""
    said: tuple[Remark, ...] = ()
    """Where the series or the drawbar force is not that of the test before."""


class Order:
    """The places of tap tests that are shown in order of time."""

    def __init__(self, baselines: Sequence[datetime] = ()) -> None:
        """baselines: oldest first. None is shown yet."""
        self.places: list[Place] = []
        """Of those that were shown."""
        self._baselines = baselines
        self._newest: dict[str, dict[str, int]] = {}
        self._mountings = Mountings()

    def add(self, tap: TapEntry) -> None:
        """The next one."""
        found, number = self.places, len(self.places)
        baseline = _before(tap, self._baselines) if self._baselines else None
        if found and found[-1].baseline != baseline:
            self._newest, self._mountings = {}, Mountings()
        series, said = self._mountings.place(tap)
        mine, other = self._newest.setdefault(series, {}), None
        for direction, newest in mine.items():
            if direction != tap.direction and (other is None or newest > other):
                other = newest
        found.append(Place(number, tap, mine.get(tap.direction), other, baseline, series, said))
        mine[tap.direction] = number


def places(taps: Iterable[TapEntry], baselines: Sequence[datetime] = ()) -> list[Place]:
    """taps, baselines: oldest first."""
    order = Order(baselines)
    for tap in taps:
        order.add(tap)
    return order.places


def _before(tap: TapEntry, baselines: Sequence[datetime]) -> datetime | None:
    time = datetime.fromisoformat(tap.time)
    return next((one for one in reversed(baselines) if one <= time), None)


def earlier_numbers(place: Place, among: Sequence[Place]) -> Iterator[int]:
    """Numbers of the tap tests of the same series and direction before it, the newest first."""
    while place.before is not None:
        place = among[place.before]
        yield place.number
