"""Capture hits from a stream of scans or from one long record.

again when the structure is at rest.
"""

from __future__ import annotations

import functools
import operator
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from acquisition.arrays import Codes, Floats
from acquisition.channel import Block, Channel, ChannelQuantity
from acquisition.hit import Hit, TapInputs
from acquisition.source import Source

MAX_REST_RMS_RATIO = 2.0
"""The response is at rest where its rms is at most this many times that of the baseline ..."""
MAX_REST_CODES = 2.0
"""... or this many steps of the converter."""
STEADY_RMS_SHARE = 0.8
"""A response does not fall where the median rms of the second half of what was seen is this share of the first's."""


class RestDetector:
    """The level of rest of one response, in steps of the converter."""

    def __init__(self, rms: float, patience: int) -> None:
        """rms: of the baseline (steps); patience: after how many stretches that do not fall they are the new baseline,
        e.g. because of a machine started next door."""
        self._rms = rms
        self._seen: deque[float] = deque(maxlen=patience)

    def is_at_rest(self, response: Codes) -> bool:
        """Whether the structure is at rest over these samples."""
        return bool(np.std(response) <= max(MAX_REST_RMS_RATIO * self._rms, MAX_REST_CODES))

    def update(self, response: Codes) -> bool:
        """The same, for the next of successive stretches that rest is waited for in."""
        self._seen.append(float(np.std(response)))
        if len(self._seen) == self._seen.maxlen:
            half = len(self._seen) // 2
            first, second = (np.median(list(self._seen)[part]) for part in (slice(half), slice(half, None)))
            if second >= STEADY_RMS_SHARE * first:
                self._rms = max(self._rms, float(second))
        if not self.is_at_rest(response):
            return False
        self._seen.clear()
        return True


NEW_BASELINE_TIME = 2.0
"""A response that has not fallen for so long is no ringing but the new baseline (s)."""


@dataclass(frozen=True)
class Trigger:
    """When a record begins and how long it is."""

    level: float
    """Force that starts a record when crossed upwards (N); size of the acceleration where that starts it (m/s^2)."""
    n_samples: int
    """Length of a record (samples)."""
    pre_trigger: int
    """Samples kept from before the crossing."""
    hysteresis: float = 0.5
    """The trigger arms only after the quantity has stayed below this share of the level for pre_trigger samples."""
    rest_rms: float | None = None
    """rms of the acceleration at rest (m/s^2): armed only after pre_trigger samples at rest; None arms
    by the level alone."""
    quantity: ChannelQuantity = "force"
    """Quantity that starts a record: the acceleration where no sensor measures the force."""
    offset: float = 0.0
    """Value of that quantity at rest, from which the level counts (N or m/s^2): a sensor may feel gravity."""

    def __post_init__(self) -> None:
        """Refuse what cannot trigger."""
        if not (np.isfinite(self.level) and self.level > 0):
            raise ValueError(f"trigger level={self.level} is not > 0")
        if not 0 < self.pre_trigger < self.n_samples:
            raise ValueError(f"pre_trigger={self.pre_trigger} samples is not between 1 and n_samples={self.n_samples}")


def capture_hits(source: Source, trigger: Trigger) -> Iterator[Hit]:
    """Hits of a started source, one after the other, unchecked; scans that were lost inside one are counted in it.

    Nothing is interpolated: a record with a gap has its samples closed up and `lost_scans` > 0.

    >>> spindle = Structure(np.array([500.0]), np.array([0.02]), np.array([2e7]))
    >>> careful = Hammering(double_hits=0.0, overloads=0.0)
    >>> tapped = HammeredStructure(spindle, 10240.0, np.random.default_rng(1), careful)
    >>> sensors = Channel("force", 2.25e-3, 5.0), Channel("acceleration", 1e-3, 5.0)
    >>> source = SimulatedSource(tapped, sensors, 10240.0, n_scans=20480)  # 2 s
    >>> source.start()
    >>> hits = list(capture_hits(source, Trigger(level=20.0, n_samples=2048, pre_trigger=100)))
    >>> len(hits), [check_hit(hit) == HitFlags.OK for hit in hits]
    (4, [True, True, True, True])
    """
    search = HitSearch(source.channels, source.sample_rate, trigger)
    for block in source.blocks():
        yield from search.feed(block)


class HitSearch:
    """The scans not yet done with, and where in them the search stands (positions count scans received)."""

    def __init__(
        self, channels: tuple[Channel, ...], sample_rate: float, trigger: Trigger, direction: str = ""
    ) -> None:
        """Search a stream of these channels from its next scan on; direction: as for `select_input_channels`."""
        self._inputs = TapInputs.select(channels, trigger.quantity, direction)
        self._used = self._inputs.channels
        self._rate, self._trigger = sample_rate, trigger
        self._level, self._middle = trigger.level / abs(self._used[0].scale), trigger.offset / self._used[0].scale
        self._gap = 1 if trigger.quantity == "force" else trigger.pre_trigger
        self._codes: Codes = np.empty((len(self._used), 0), np.int32)
        self._added: list[Codes] = []
        self._size = 0
        self._from = 0
        self._quiet = 0
        self._crossing: int | None = None
        self._gaps: list[tuple[int, int]] = []
        self._overloads: list[tuple[int, int, int]] = []
        self._rest: RestDetector | None = None
        if trigger.rest_rms is not None:
            patience = max(round(NEW_BASELINE_TIME * sample_rate / trigger.pre_trigger), 2)
            self._rest = RestDetector(trigger.rest_rms / abs(self._used[-1].scale), patience)
        self._settled = self._rest is None
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
            self._gaps.append((self._size, block.lost_before))
        self._add(block)
        while (record := self._next_record()) is not None:
            codes, lost, overload = record
            yield self._inputs.make_hit(codes, self._rate, self._trigger.pre_trigger, lost, overload)

    def _add(self, block: Block) -> None:
        overload = sum((block.overload >> row & 1) << i for i, row in enumerate(self._inputs.rows))
        end = self._size + block.codes.shape[1]
        if overload:
            self._overloads.append((self._size, end, overload))
        is_all = self._inputs.rows == tuple(range(len(block.codes)))
        self._added.append(block.codes if is_all else block.codes[list(self._inputs.rows)])
        self._size = end

    def _next_record(self) -> tuple[Codes, int, int] | None:
        """The next complete record, the scans lost in it and its overloads; None until more blocks have come."""
        if self._crossing is None and not self._trigger_on_crossing():
            self._forget(self._from - self._trigger.pre_trigger)
            return None
        start = (self._crossing or 0) - self._trigger.pre_trigger
        end = start + self._trigger.n_samples
        if end > self._size:
            return None
        self._join()
        record = self._codes[:, start:end].copy()
        lost = sum(count for position, count in self._gaps if start < position < end)
        masks = (mask for first, last, mask in self._overloads if first < end and last > start)
        self._from, self._quiet, self._crossing, self._settled = end, 0, None, self._rest is None
        return record, lost, functools.reduce(operator.or_, masks, 0)

    def _join(self) -> None:
        """Not at every block: a record under way would be copied as often."""
        self._codes = np.concatenate([self._codes, *self._added], axis=1)
        self._added.clear()

    def _heard(self, start: int, end: int | None = None) -> Floats:
        """Codes of what triggers, positive for a hit: the acceleration swings to either side of its rest."""
        codes = self._codes[0, start:end] - self._middle
        swings = self._trigger.quantity == "acceleration"
        return np.asarray(np.abs(codes) if swings else np.sign(self._used[0].scale) * codes, dtype=np.float64)

    def _trigger_on_crossing(self) -> bool:
        """Find the next crossing that is preceded by rest; hits before it are passed over."""
        self._join()
        before = self._trigger.pre_trigger
        while self._settled or self._settle():
            crossing = self._find_crossing()
            if crossing is None:
                return False
            # The pulse may begin before its crossing.
            quiet = self._codes[-1, crossing - before : crossing - before // 5]
            if self._rest is None or self._rest.is_at_rest(quiet):
                self._crossing = crossing
                return True
            self.too_early += 1
            self._from, self._quiet, self._settled = crossing + 1, 0, False
        return False

    def _settle(self) -> bool:
        """Step over stretches of pre_trigger samples to the end of the first one without a hit and at rest."""
        width = self._trigger.pre_trigger
        while self._rest is not None and self._from + width <= self._codes.shape[1]:
            start, self._from = self._from, self._from + width
            heard = self._heard(max(start - 1, 0), self._from)
            above = heard >= self._level
            self.too_early += int(np.count_nonzero(above[1:] & ~above[:-1]))
            still = self._rest.update(self._codes[-1, start : self._from])
            if still and np.max(heard) < self._trigger.hysteresis * self._level:
                self._settled, self._quiet = True, width
                return True
        return False

    def _find_crossing(self) -> int | None:
        """First sample at the level in a loud run that follows pre_trigger quiet samples.

        Loud is above the hysteresis level; what swings is loud in between, too. A run that is still open at the end is
        looked at again with the next block, unless it has lasted a whole record (an offset, not a hit).
        """
        heard = self._heard(self._from)
        loud = np.flatnonzero(heard >= self._trigger.hysteresis * self._level)
        if not loud.size:
            self._quiet += heard.size
            self._from += heard.size
            return None
        starts = loud[np.diff(loud, prepend=-self._gap - 1) > self._gap]
        ends = loud[np.diff(loud, append=heard.size + self._gap) > self._gap] + 1
        quiet = starts - np.concatenate(([-self._quiet], ends[:-1]))
        armed = quiet >= self._trigger.pre_trigger
        for start, end in zip(starts[armed], ends[armed], strict=True):
            above = heard[start:end] >= self._level
            if above.any():
                return self._from + int(start) + int(np.argmax(above))
        if heard.size - ends[-1] < self._gap and heard.size - starts[-1] < self._trigger.n_samples:
            self._quiet = int(quiet[-1])
            self._from += int(starts[-1])
        else:
            self._quiet = int(heard.size - ends[-1])
            self._from += heard.size
        return None

    def _forget(self, count: int) -> None:
        if count <= 0:
            return
        self._codes = self._codes[:, count:]
        self._size -= count
        self._from -= count
        self._gaps = [(position - count, lost) for position, lost in self._gaps if position > count]
        self._overloads = [(first - count, last - count, mask) for first, last, mask in self._overloads if last > count]


MIN_HIT_SPACING = 0.2
"""A pulse that comes sooner after the one before is a second touch: a hammer bounces within 0.1 s (s)."""
PULSE_LEVEL_SHARE = 0.1
"""A pulse is one where the force is above this share of the largest ..."""
PULSE_NOISE_RATIO = 10.0
"""... and so many times its noise."""
PRE_HIT_TIME = 0.02
"""Kept before each pulse, at rest (s)."""
REST_RESPONSE_SHARE = 0.02
"""The response is at rest where its rms over BEFORE is at most this share of the loudest after the hit before ..."""
REST_NOISE_RATIO = 2.0
"""... or so many times that of the quietest tenth of the record."""
MIN_LAST_HIT_SHARE = 0.5
"""The last hit is left out where the record ends sooner after it than after this share of the others."""


def split_record(record: Hit) -> list[Hit]:
    """Each hit of a record by itself, all of one length; the record itself where it holds one hit or none.

    A hit begins where the force rises at least 0.2 s after the pulse before and the response has come to rest; what
    comes sooner belongs to the hit before it, which is then a double hit, or has not decayed. All are as long as the
    shortest; nothing is interpolated.
    """
    starts = _find_hit_starts(record)
    if len(starts) < 2:
        return [record]
    before = min(round(PRE_HIT_TIME * record.sample_rate), int(starts[0]))
    begins = starts - before
    lengths = np.diff(begins, append=record.acceleration.size)
    n = int(np.min(lengths[:-1]))
    if lengths[-1] < MIN_LAST_HIT_SHARE * n:
        begins = begins[:-1]
    n = min(n, int(np.min(record.acceleration.size - begins)))
    return [_cut_hit(record, int(a), n, before) for a in begins]


def _cut_hit(record: Hit, begin: int, size: int, before: int) -> Hit:
    inside = slice(begin, begin + size)
    force = record.force[inside] if record.has_force else record.force
    return replace(record, force=force, acceleration=record.acceleration[inside], pre_trigger=before)


def _find_hit_starts(record: Hit) -> NDArray[np.intp]:
    """Samples at which the force rises at the beginning of a hit, or without one the response."""
    force, rate = record.signals[0] - np.median(record.signals[0]), record.sample_rate
    force = force if record.has_force else np.abs(force)
    noise = 1.4826 * float(np.median(np.abs(force)))
    loud = np.flatnonzero(force > max(PULSE_LEVEL_SHARE * float(np.max(force)), PULSE_NOISE_RATIO * noise))
    rises = loud[np.diff(loud, prepend=-force.size) > MIN_HIT_SPACING * rate]
    if rises.size < 2:
        return rises
    width = max(round(PRE_HIT_TIME * rate), 8)
    levels = _compute_stretch_rms(record.acceleration, width)
    quiet = REST_NOISE_RATIO * float(np.quantile(levels, 0.1))
    kept = [rises[0]]
    for rise in rises[1:]:
        since = levels[int(kept[-1]) // width : max(int(rise) // width, int(kept[-1]) // width + 1)]
        now = float(np.std(record.acceleration[max(rise - width, 0) : max(rise - width // 5, 8)]))
        if now <= max(REST_RESPONSE_SHARE * float(np.max(since)), quiet):
            kept.append(rise)
    return np.array(kept)


def _compute_stretch_rms(response: Floats, width: int) -> Floats:
    """rms about its mean of each stretch of so many samples; at least one."""
    count = max(response.size // width, 1)
    return np.array([float(np.std(part)) for part in np.array_split(response[: count * width], count)])
