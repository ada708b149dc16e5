"""From the watch over the points of a series to its falls: what raises an alarm, what closes it, what begins the watch
anew.

Two points running that are sure of a fall raise an alarm; four running that are not close it. Nothing else does: no
rise, and nothing that was done to the machine. A sure rise begins the watch anew at the point that was sure of it, for
among the lower points before no fall would be seen any more. (From where it seems to have risen, chance rises would
begin it at their highest points, and a third of them would end as a fall.) An alarm that is open goes on to be judged
by its own watch.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lobewatch.decay.change_point import SURE, Fall, Floats, Watch, watch_both
from lobewatch.decay.readings import Readings

CALM = 4
"""Points running, none of them sure of the fall, that close an alarm; chosen."""


class DetectedFall(NamedTuple):
    """A fall that has raised an alarm; points by their index in the series."""

    raised: int
    """Point that raised it, the second one running that was sure."""
    closed: int | None
    """Point that closed it; None while it is open."""
    fall: Fall
    """Kind and beginning as they were when it was raised, size as it is now."""


@dataclass(frozen=True, eq=False)
class Detection:
    """What has been seen of a series."""

    scores: Floats
    """Score of each point in the watch of its time, shape (n,); NaN for the first 8 points of a watch."""
    falls: tuple[DetectedFall, ...]
    """Falls that have raised an alarm, oldest first."""
    rise: Fall | None
    """Newest sure rise, which the watch began anew with, its size positive; None where there is none."""

    @property
    def open_falls(self) -> tuple[DetectedFall, ...]:
        """Falls whose alarm is open."""
        return tuple(fall for fall in self.falls if fall.closed is None)

    @property
    def asks_again(self) -> bool:
        """Whether the newest point alone is sure of a fall."""
        return not self.open_falls and self.scores.size > 0 and bool(self.scores[-1] >= SURE)


def detect(readings: Readings) -> Detection:
    """What is to be seen of a series."""
    count = readings.y.size
    scores, falls, rise = np.full(count, np.nan), list[DetectedFall](), None
    begin = judged = 0
    while judged < count:
        down, up = watch_both(readings.since(begin))
        end = count if up.alarm_at is None else begin + up.alarm_at + 1
        scores[judged:end] = down.scores[judged - begin : end - begin]
        falls += _falls(down, begin, judged, end)
        judged = end
        if up.alarm_at is not None:
            seen = up.fall_at(up.alarm_at)
            rise, begin = seen._replace(point=begin + seen.point), begin + up.alarm_at
    return Detection(scores, tuple(falls), rise)


def _falls(watch: Watch, begin: int, first: int, end: int) -> Iterator[DetectedFall]:
    """Falls that a watch from one point on raises an alarm for between two others."""
    raised = next(watch.alarms_from(first - begin), None)
    while raised is not None and begin + raised < end:
        closed = _closed(watch, raised)
        fall = watch.fall_at(raised)
        shifted = fall._replace(point=begin + fall.point)
        yield DetectedFall(begin + raised, None if closed is None else begin + closed, shifted)
        raised = None if closed is None else next(watch.alarms_from(closed + 1), None)


def _closed(watch: Watch, raised: int) -> int | None:
    """Point that closes an alarm."""
    calm = 0
    for point in range(raised + 1, watch.scores.size):
        calm = 0 if watch.sure[point] else calm + 1
        if calm == CALM:
            return point
    return None
