"""Tap tests in order of time, each with those before it that it builds on."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from datetime import datetime

import msgspec

from acquisition import ACROSS, Remark
from lobewatch.machine import TapEntry
from lobewatch.tool.mountings import MountedTools


class Place(msgspec.Struct, frozen=True, gc=False):
    """One tap test among all of a machine."""

    number: int
    """Number from 0, the oldest."""
    entry: TapEntry
    """Tap test as it stands in the journal."""
    before: int | None
    """Place of the one before it of the same series and direction."""
    across: int | None
    """Place of the newest one before it of the same series in another direction, x or y."""
    baseline: datetime | None = None
    """The event before it from which on all comparing begins anew; nothing before that is built on."""
    series: str = ""
    """Identity of the first tap test of its series: of one tool with one stick-out in one state, both directions, since
    the baseline."""
    cross: int | None = None
    """Place of the newest cross tap of the same series, itself where it is; None without any."""
    remarks: tuple[Remark, ...] = ()
    """Remarks where the series or the drawbar force is not that of the test before."""


class Order:
    """The places of tap tests that are shown in order of time."""

    def __init__(self, baselines: Sequence[datetime] = ()) -> None:
        """baselines: oldest first. None is shown yet."""
        self.places: list[Place] = []
        """Places of those that were shown."""
        self._baselines = baselines
        self._newest: dict[str, dict[str, int]] = {}
        self._mountings = MountedTools()

    def add(self, tap: TapEntry) -> None:
        """The next one."""
        number, baseline = len(self.places), _before(tap, self._baselines) if self._baselines else None
        if self.places and self.places[-1].baseline != baseline:
            self._newest, self._mountings = {}, MountedTools()
        series, remarks = self._mountings.place(tap)
        newest = self._newest.setdefault(series, {})
        across = None
        for direction, place in newest.items():
            if direction not in (tap.direction, ACROSS) and (across is None or place > across):
                across = place
        before = newest.get(tap.direction)
        newest[tap.direction] = number
        self.places.append(Place(number, tap, before, across, baseline, series, newest.get(ACROSS), remarks))


def places(taps: Iterable[TapEntry], baselines: Sequence[datetime] = ()) -> list[Place]:
    """taps, baselines: oldest first."""
    order = Order(baselines)
    for tap in taps:
        order.add(tap)
    return order.places


def _before(tap: TapEntry, baselines: Sequence[datetime]) -> datetime | None:
    time = datetime.fromisoformat(tap.time)
    return next((baseline for baseline in reversed(baselines) if baseline <= time), None)


def earlier_numbers(place: Place, among: Sequence[Place]) -> Iterator[int]:
    """Numbers of the tap tests of the same series and direction before it, the newest first."""
    while place.before is not None:
        place = among[place.before]
        yield place.number
