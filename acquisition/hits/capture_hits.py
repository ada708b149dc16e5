"""Capture hits from a stream of scans or from one long record.

A hit starts at a crossing of the trigger level, with hysteresis and real pre-trigger samples. The trigger arms again
when the structure is at rest.
"""

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
"""Largest rms of a response at rest over that of the baseline."""
MAX_REST_CODES = 2.0
"""Largest rms of a response at rest in converter steps."""
STEADY_RMS_SHARE = 0.8
"""Median rms of the second half of the observed stretches over that of the first half from which a response is steady.
"""


class RestDetector:
    """Detector of rest for one response, in steps of the converter."""

    def __init__(self, rms: float, patience: int) -> None:
        """Start with the rms of the baseline (steps).

        patience: number of stretches after which a steady level becomes the new baseline, e.g. of a machine next door.
        """
        self._rms = rms
        self._seen: deque[float] = deque(maxlen=patience)

    def is_at_rest(self, response: Codes) -> bool:
        """Return whether the structure is at rest over these samples."""
        return bool(np.std(response) <= max(MAX_REST_RMS_RATIO * self._rms, MAX_REST_CODES))

    def update(self, response: Codes) -> bool:
        """Take the next stretch while waiting for rest, and return whether the structure is at rest in it."""
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
"""Time after which a steady response is the new baseline instead of ringing (s)."""


@dataclass(frozen=True)
class Trigger:
    """Start and length of a record."""

    level: float
    """Force that starts a record when crossed upwards (N), or absolute acceleration where that triggers (m/s^2)."""
    n_samples: int
    """Length of a record (samples)."""
    pre_trigger: int
    """Samples to keep from before the crossing."""
    hysteresis: float = 0.5
    """Share of the level below which the quantity must stay for pre_trigger samples before the trigger arms."""
    rest_rms: float | None = None
    """Rms of the acceleration at rest (m/s^2): the trigger arms only after pre_trigger samples at rest. None: no such
    check.
    """
    quantity: ChannelQuantity = "force"
    """Quantity that triggers: the acceleration where no sensor measures the force."""
    offset: float = 0.0
    """Value of that quantity at rest, from which the level counts (N or m/s^2), e.g. gravity."""

    def __post_init__(self) -> None:
        if not (np.isfinite(self.level) and self.level > 0):
            raise ValueError(f"trigger level={self.level} is not above 0")
        if not 0 < self.pre_trigger < self.n_samples:
            raise ValueError(f"pre_trigger={self.pre_trigger} samples is not between 1 and n_samples={self.n_samples}")


def capture_hits(source: Source, trigger: Trigger, direction: str = "") -> Iterator[Hit]:
    """Yield the hits of a started source without evaluating them.

    Nothing is interpolated: a record with a gap has its samples closed up and `lost_scans` > 0.

    Parameters
    ----------
    source
        Started source.
    trigger
        Start and length of a record.
    direction
        Direction of the hits; selects one of several responses as `TapInputs.select` does.

    Yields
    ------
    Hit
        Hits in the order of their time.

    Examples
    --------
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
    search = HitSearch(source.channels, source.sample_rate, trigger, direction)
    for block in source.blocks():
        yield from search.feed(block)


class HitSearch:
    """Search of a stream for hits."""

    def __init__(
        self, channels: tuple[Channel, ...], sample_rate: float, trigger: Trigger, direction: str = ""
    ) -> None:
        """Search a stream of these channels from its next scan on.

        Parameters
        ----------
        channels
            Channels of the stream.
        sample_rate
            Sample rate (Hz).
        trigger
            Start and length of a record.
        direction
            Direction of the hits; selects one of several responses as `TapInputs.select` does.
        """
        self._inputs = TapInputs.select(channels, trigger.quantity, direction)
        self._used = self._inputs.channels
        self._rate, self._trigger = sample_rate, trigger
        self._level, self._offset = trigger.level / abs(self._used[0].scale), trigger.offset / self._used[0].scale
        self._gap = 1 if trigger.quantity == "force" else trigger.pre_trigger
        self._codes: Codes = np.empty((len(self._used), 0), np.int32)
        self._added: list[Codes] = []
        self._size = 0
        self._position = 0
        self._quiet_count = 0
        self._crossing: int | None = None
        self._gaps: list[tuple[int, int]] = []
        self._overloads: list[tuple[int, int, int]] = []
        self._rest: RestDetector | None = None
        if trigger.rest_rms is not None:
            patience = max(round(NEW_BASELINE_TIME * sample_rate / trigger.pre_trigger), 2)
            self._rest = RestDetector(trigger.rest_rms / abs(self._used[-1].scale), patience)
        self._rested = self._rest is None
        self.too_early = 0
        """Hits passed over because the structure was not at rest."""

    @property
    def recording(self) -> bool:
        """True if a hit is being recorded."""
        return self._crossing is not None

    @property
    def armed(self) -> bool:
        """True if the next hit would be recorded."""
        return self._crossing is None and self._rested and self._quiet_count >= self._trigger.pre_trigger

    def feed(self, block: Block) -> Iterator[Hit]:
        """Yield the hits that are complete with this block.

        Parameters
        ----------
        block
            Next scans of the stream.
        """
        if block.lost_before:
            self._gaps.append((self._size, block.lost_before))
        overload = sum((block.overload >> row & 1) << i for i, row in enumerate(self._inputs.rows))
        end = self._size + block.codes.shape[1]
        if overload:
            self._overloads.append((self._size, end, overload))
        is_all = self._inputs.rows == tuple(range(len(block.codes)))
        self._added.append(block.codes if is_all else block.codes[list(self._inputs.rows)])
        self._size = end
        while (record := self._next_record()) is not None:
            codes, lost, overload = record
            yield self._inputs.make_hit(codes, self._rate, self._trigger.pre_trigger, lost, overload)

    def _next_record(self) -> tuple[Codes, int, int] | None:
        """Return the next complete record, its lost scans and its overloads; None until more blocks arrive."""
        if self._crossing is None and not self._trigger_on_crossing():
            self._forget(self._position - self._trigger.pre_trigger)
            return None
        start = (self._crossing or 0) - self._trigger.pre_trigger
        end = start + self._trigger.n_samples
        if end > self._size:
            return None
        self._join()
        record = self._codes[:, start:end].copy()
        lost = sum(count for position, count in self._gaps if start < position < end)
        masks = (mask for first, last, mask in self._overloads if first < end and last > start)
        self._position, self._quiet_count, self._crossing, self._rested = end, 0, None, self._rest is None
        return record, lost, functools.reduce(operator.or_, masks, 0)

    def _join(self) -> None:
        """Join the blocks, but not at every block: a record in progress would be copied as often."""
        self._codes = np.concatenate([self._codes, *self._added], axis=1)
        self._added.clear()

    def _get_trigger_signal(self, start: int, end: int | None = None) -> Floats:
        """Return the triggering codes, positive for a hit; an acceleration swings to either side of its rest."""
        codes = self._codes[0, start:end] - self._offset
        swings = self._trigger.quantity == "acceleration"
        return np.asarray(np.abs(codes) if swings else np.sign(self._used[0].scale) * codes, dtype=np.float64)

    def _trigger_on_crossing(self) -> bool:
        """Find the next crossing after rest, and pass over hits before it."""
        self._join()
        before = self._trigger.pre_trigger
        while self._rested or self._wait_for_rest():
            crossing = self._find_crossing()
            if crossing is None:
                return False
            # The pulse may begin before its crossing.
            quiet = self._codes[-1, crossing - before : crossing - before // 5]
            if self._rest is None or self._rest.is_at_rest(quiet):
                self._crossing = crossing
                return True
            self.too_early += 1
            self._position, self._quiet_count, self._rested = crossing + 1, 0, False
        return False

    def _wait_for_rest(self) -> bool:
        """Step over stretches of pre_trigger samples to the end of the first one without a hit and at rest."""
        width = self._trigger.pre_trigger
        while self._rest is not None and self._position + width <= self._codes.shape[1]:
            start, self._position = self._position, self._position + width
            signal = self._get_trigger_signal(max(start - 1, 0), self._position)
            above = signal >= self._level
            self.too_early += int(np.count_nonzero(above[1:] & ~above[:-1]))
            still = self._rest.update(self._codes[-1, start : self._position])
            if still and np.max(signal) < self._trigger.hysteresis * self._level:
                self._rested, self._quiet_count = True, width
                return True
        return False

    def _find_crossing(self) -> int | None:
        """Find the first sample at the level in a loud run after pre_trigger quiet samples.

        Loud is above the hysteresis level, and the gaps of a swinging signal count as loud. A run that is open at the
        end is searched again with the next block, unless it has lasted a whole record: then it is an offset instead of
        a hit.
        """
        signal = self._get_trigger_signal(self._position)
        loud = np.flatnonzero(signal >= self._trigger.hysteresis * self._level)
        if not loud.size:
            self._quiet_count += signal.size
            self._position += signal.size
            return None
        starts = loud[np.diff(loud, prepend=-self._gap - 1) > self._gap]
        ends = loud[np.diff(loud, append=signal.size + self._gap) > self._gap] + 1
        quiet = starts - np.concatenate(([-self._quiet_count], ends[:-1]))
        armed = quiet >= self._trigger.pre_trigger
        for start, end in zip(starts[armed], ends[armed], strict=True):
            above = signal[start:end] >= self._level
            if above.any():
                return self._position + int(start) + int(np.argmax(above))
        if signal.size - ends[-1] < self._gap and signal.size - starts[-1] < self._trigger.n_samples:
            self._quiet_count = int(quiet[-1])
            self._position += int(starts[-1])
        else:
            self._quiet_count = int(signal.size - ends[-1])
            self._position += signal.size
        return None

    def _forget(self, count: int) -> None:
        if count <= 0:
            return
        self._codes = self._codes[:, count:]
        self._size -= count
        self._position -= count
        self._gaps = [(position - count, lost) for position, lost in self._gaps if position > count]
        self._overloads = [(first - count, last - count, mask) for first, last, mask in self._overloads if last > count]


MIN_HIT_SPACING = 0.2
"""Time below which a pulse belongs to the hit before it (s): a hammer bounces within 0.1 s."""
PULSE_LEVEL_SHARE = 0.1
"""Level of a pulse as a share of the largest force."""
PULSE_NOISE_RATIO = 10.0
"""Level of a pulse over the noise of the force."""
PRE_HIT_TIME = 0.02
"""Time at rest to keep before each pulse (s)."""
REST_RESPONSE_SHARE = 0.02
"""Largest rms of a response at rest over the loudest stretch since the previous hit."""
REST_NOISE_RATIO = 2.0
"""Largest rms of a response at rest over the quietest tenth of the record."""
MIN_LAST_HIT_SHARE = 0.5
"""Shortest last hit that is kept, as a share of the others' length."""


def split_record(record: Hit) -> list[Hit]:
    """Split a long record into its hits, all of one length; return the record itself where it holds one hit or none.

    A hit begins where the force rises at least 0.2 s after the previous pulse and the response is at rest. What comes
    sooner belongs to the previous hit, which is then a double hit or has not decayed. Nothing is interpolated.
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
    hits = list[Hit]()
    for part in (slice(int(begin), int(begin) + n) for begin in begins):
        force = record.force[part]  # empty if it was not measured
        hits.append(replace(record, force=force, acceleration=record.acceleration[part], pre_trigger=before))
    return hits


def _find_hit_starts(record: Hit) -> NDArray[np.intp]:
    """Return the samples at which the force rises at the start of a hit; without a force, the response."""
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
    """Return the rms about the mean of each stretch of `width` samples, at least one."""
    count = max(response.size // width, 1)
    return np.array([float(np.std(part)) for part in np.array_split(response[: count * width], count)])
