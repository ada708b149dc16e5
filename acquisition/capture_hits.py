"""From a stream of scans to single hits: trigger on a crossing, with hysteresis and real pre-trigger samples, armed
again when the structure is at rest."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.channel import Block, Channel
from acquisition.errors import DataError
from acquisition.hit import Hit
from acquisition.source import Source

REST_FACTOR = 2.0
"""The response is at rest where its rms is at most this many times that of the baseline ..."""
REST_CODES = 2.0
"""... or this many steps of the converter."""
STEADY_TIME = 1.0
"""A response that has not fallen over twice this time is the new baseline (s)."""
STEADY_SHARE = 0.8
"""It has not fallen where the median of the second half is at least this share of that of the first."""


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
    rest_rms: float | None = None
    """rms of the acceleration at rest (m/s^2): armed only after pre_trigger samples within REST_FACTOR of it; None arms
    by the force alone."""

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
    search = HitSearch(source.channels, source.sample_rate, trigger)
    for block in source.blocks():
        yield from search.feed(block)


def input_channels(channels: tuple[Channel, ...]) -> tuple[int, int]:
    """Index of the force and of the acceleration channel; DataError unless there is one of each."""
    quantities = [channel.quantity for channel in channels]
    if quantities.count("force") != 1 or quantities.count("acceleration") != 1:
        raise DataError(
            f"the DAQ has channels for {', '.join(quantities) or 'nothing'}; "
            "one force and one acceleration channel are needed"
        )
    return quantities.index("force"), quantities.index("acceleration")


class HitSearch:
    """The scans not yet done with, and where in them the search stands (positions count scans received)."""

    def __init__(self, channels: tuple[Channel, ...], sample_rate: float, trigger: Trigger) -> None:
        """Search a stream of these channels from its next scan on."""
        self._rows = list(input_channels(channels))
        self._pair = (channels[self._rows[0]], channels[self._rows[1]])
        self._rate, self._trigger = sample_rate, trigger
        self._level = trigger.level / self._pair[0].scale
        self._codes: NDArray[np.int32] = np.empty((2, 0), np.int32)
        self._from = 0
        self._quiet = 0
        self._crossing: int | None = None
        self._gaps: list[tuple[int, int]] = []
        self._rest = None if trigger.rest_rms is None else trigger.rest_rms / abs(self._pair[1].scale)
        self._settled = self._rest is None
        self._levels: deque[float] = deque(maxlen=2 * max(round(STEADY_TIME * sample_rate / trigger.pre_trigger), 1))
        self.too_early = 0
        """Hits passed over because the structure was not at rest."""

    @property
    def recording(self) -> bool:
        """Whether a hit is being recorded."""
        return self._crossing is not None

    @property
    def armed(self) -> bool:
        """Whether a hit that comes now is recorded."""
        return self._crossing is None and self._settled and self._quiet >= self._trigger.pre_trigger

    def feed(self, block: Block) -> Iterator[Hit]:
        """The hits that are complete with this block."""
        if block.lost_before:
            self._gaps.append((self._codes.shape[1], block.lost_before))
        self._codes = np.concatenate([self._codes, block.codes[self._rows]], axis=1)
        while (record := self._next_record()) is not None:
            yield Hit.from_codes(record[0], self._pair, self._rate, self._trigger.pre_trigger, record[1])

    def _next_record(self) -> tuple[NDArray[np.int32], int] | None:
        """The next complete record and the scans lost in it; None until more blocks have come."""
        before = self._trigger.pre_trigger
        while self._crossing is None:
            found = self._find_crossing() if self._settled or self._settle() else None
            if found is None:
                self._forget(self._from - before)
                return None
            self._accept(found)
        start = self._crossing - before
        end = start + self._trigger.n_samples
        if end > self._codes.shape[1]:
            return None
        record = self._codes[:, start:end].copy()
        lost = sum(count for position, count in self._gaps if start < position < end)
        self._from, self._quiet, self._crossing, self._settled = end, 0, None, self._rest is None
        self._levels.clear()
        return record, lost

    def _accept(self, crossing: int) -> None:
        """Record the hit that crosses here where the response was at rest before it, else pass it over."""
        before = self._codes[1, crossing - self._trigger.pre_trigger : crossing]
        if self._is_at_rest(float(np.std(before[: max(int(0.8 * before.size), 1)]))):
            self._crossing = crossing
        else:
            self.too_early += 1
            self._from, self._quiet, self._settled = crossing, 0, False
            self._step()

    def _is_at_rest(self, rms: float) -> bool:
        """Whether the response has this rms (codes) at rest."""
        return self._rest is None or rms <= max(REST_FACTOR * self._rest, REST_CODES)

    def _settle(self) -> bool:
        """Step over stretches of pre_trigger samples to the end of the first one without force and at rest."""
        width = self._trigger.pre_trigger
        while not self._settled and self._from + width <= self._codes.shape[1]:
            above = self._codes[0, max(self._from - 1, 0) : self._from + width] >= self._level
            self.too_early += int(np.count_nonzero(above[1:] & ~above[:-1]))
            force, response = self._step()
            self._levels.append(float(np.std(response)))
            self._relearn()
            quiet = bool(np.max(force) < self._trigger.hysteresis * self._level)
            if quiet and self._is_at_rest(self._levels[-1]):
                self._settled, self._quiet = True, width
        return self._settled

    def _step(self) -> NDArray[np.int32]:
        stretch = self._codes[:, self._from : self._from + self._trigger.pre_trigger]
        self._from += stretch.shape[1]
        return stretch

    def _relearn(self) -> None:
        """What has not fallen for long is no ringing but the new baseline, e.g. of a machine started next door."""
        if self._rest is None or len(self._levels) < (self._levels.maxlen or 0):
            return
        first, second = np.median(np.reshape(self._levels, (2, -1)), axis=1)
        if second >= STEADY_SHARE * first:
            self._rest = max(self._rest, float(second))

    def _find_crossing(self) -> int | None:
        """First sample at the level in a loud run that follows pre_trigger quiet samples.

        Loud is above the hysteresis level. A run that is still open at the end is looked at again with the next
        block, unless it has lasted a whole record (an offset, not a hit).
        """
        force = self._codes[0, self._from :]
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
        self._from -= count
        self._gaps = [(position - count, lost) for position, lost in self._gaps if position > count]
