"""From a stream of scans to single hits: trigger on a crossing, with hysteresis and real pre-trigger samples."""

from __future__ import annotations

import functools
import operator
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.channel import Channel
from acquisition.errors import DataError
from acquisition.hit import Hit
from acquisition.source import Source


@dataclass(frozen=True)
class Trigger:
    """When a record begins and how long it is."""

    level: float
    """Force that starts a record when crossed upwards (N)."""
    n_samples: int
    """Length of a record (samples)."""
    pre_trigger: int
    """Samples kept from before the crossing."""
    hysteresis: float = 0.5
    """The trigger arms only after the force has stayed below this share of the level for pre_trigger samples."""

    def __post_init__(self) -> None:
        """Refuse what cannot trigger."""
        if not (np.isfinite(self.level) and self.level > 0):
            raise ValueError(f"trigger level={self.level} N is not > 0")
        if not 0 < self.pre_trigger < self.n_samples:
            raise ValueError(f"pre_trigger={self.pre_trigger} samples is not between 1 and n_samples={self.n_samples}")


def capture_hits(source: Source, trigger: Trigger) -> Iterator[Hit]:
    """Hits of a started source, one after the other, unchecked; scans that were lost inside one are counted in it.

    Nothing is interpolated: a record with a gap has its samples closed up and `lost_scans` > 0.
    """
    force, response = inputs = input_channels(source.channels)
    pair = (source.channels[force], source.channels[response])
    search = _Search(trigger, pair[0].scale)
    for block in source.blocks():
        overload = (block.overload >> force & 1) | (block.overload >> response & 1) << 1
        search.add(block.codes if inputs == (0, 1) else block.codes[[force, response]], block.lost_before, overload)
        while (record := search.next_record()) is not None:
            codes, lost, overload = record
            yield Hit.from_codes(codes, pair, source.sample_rate, trigger.pre_trigger, lost, overload)


def input_channels(channels: tuple[Channel, ...]) -> tuple[int, int]:
    """Index of the force and of the acceleration channel; DataError unless there is one of each."""
    quantities = [channel.quantity for channel in channels]
    if quantities.count("force") != 1 or quantities.count("acceleration") != 1:
        raise DataError(
            f"the DAQ has channels for {', '.join(quantities) or 'nothing'}; "
            "one force and one acceleration channel are needed"
        )
    return quantities.index("force"), quantities.index("acceleration")


class _Search:
    """The scans not yet done with, and where in them the search stands (positions count scans received)."""

    def __init__(self, trigger: Trigger, newton_per_code: float) -> None:
        self._trigger = trigger
        self._level, self._sign = trigger.level / abs(newton_per_code), 1 if newton_per_code > 0 else -1
        self._codes: NDArray[np.int32] = np.empty((2, 0), np.int32)
        self._added: list[NDArray[np.int32]] = []
        self._size = 0
        self._from = 0
        self._quiet = 0
        self._crossing: int | None = None
        self._gaps: list[tuple[int, int]] = []
        self._overloads: list[tuple[int, int, int]] = []

    def add(self, codes: NDArray[np.int32], lost_before: int, overload: int) -> None:
        if lost_before:
            self._gaps.append((self._size, lost_before))
        if overload:
            self._overloads.append((self._size, self._size + codes.shape[1], overload))
        self._added.append(codes)
        self._size += codes.shape[1]

    def next_record(self) -> tuple[NDArray[np.int32], int, int] | None:
        """The next complete record, the scans lost in it and its overloads; None until more blocks have come."""
        if self._crossing is None:
            self._join()
            self._crossing = self._find_crossing()
        if self._crossing is None:
            self._forget(self._from - self._trigger.pre_trigger)
            return None
        start = self._crossing - self._trigger.pre_trigger
        end = start + self._trigger.n_samples
        if end > self._size:
            return None
        self._join()
        record = self._codes[:, start:end].copy()
        lost = sum(count for position, count in self._gaps if start < position < end)
        masks = (mask for first, last, mask in self._overloads if first < end and last > start)
        self._from, self._quiet, self._crossing = end, 0, None
        return record, lost, functools.reduce(operator.or_, masks, 0)

    def _join(self) -> None:
        """Not at every block: a record under way would be copied as often."""
        self._codes = np.concatenate([self._codes, *self._added], axis=1)
        self._added.clear()

    def _find_crossing(self) -> int | None:
        """First sample at the level in a loud run that follows pre_trigger quiet samples.

        Loud is above the hysteresis level. A run that is still open at the end is looked at again with the next
        block, unless it has lasted a whole record (an offset, not a hit).
        """
        force = self._sign * self._codes[0, self._from :]
        loud = np.flatnonzero(force >= self._trigger.hysteresis * self._level)
        starts = loud[np.diff(loud, prepend=-2) > 1]
        ends = loud[np.diff(loud, append=force.size + 1) > 1] + 1
        quiet = starts - np.concatenate(([-self._quiet], ends[:-1]))
        armed = quiet >= self._trigger.pre_trigger
        for start, end in zip(starts[armed], ends[armed], strict=True):
            above = force[start:end] >= self._level
            if above.any():
                return self._from + int(start) + int(np.argmax(above))
        if ends.size and ends[-1] == force.size and force.size - starts[-1] < self._trigger.n_samples:
            self._quiet = int(quiet[-1])
            self._from += int(starts[-1])
        else:
            self._quiet = int(force.size - ends[-1]) if ends.size else self._quiet + force.size
            self._from += force.size
        return None

    def _forget(self, count: int) -> None:
        if count <= 0:
            return
        self._codes = self._codes[:, count:]
        self._size -= count
        self._from -= count
        self._gaps = [(position - count, lost) for position, lost in self._gaps if position > count]
        self._overloads = [(first - count, last - count, mask) for first, last, mask in self._overloads if last > count]
