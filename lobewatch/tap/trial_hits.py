"""Choose trigger level and record length from trial hits."""

import math
from collections.abc import Sequence

import numpy as np

from acquisition import Channel, Hit, HitFlags, Remark, Trigger, check_hit, estimate_decay_time
from acquisition.errors import join_sentences
from lobewatch.machine.settings.setup_tables import TapTable

MIN_RECORD_TIME = 0.25
"""Shortest record, and that of the first trial hit (s). It is the same from month to month."""
MAX_RECORD_TIME = 4.0
"""Longest record (s)."""
RECORD_TIME_CONSTANTS = 6
"""Time constants of the slowest mode in a record (ISO 7626-5: then the cut-off part is < 0.5 %)."""
RECORD_TIME_STEP = 0.05
"""Step of longer records (s)."""
TRIGGER_PEAK_SHARE = 0.1
"""Trigger level over the median peak of the trial hits, chosen."""
TRIGGER_NOISE_RATIO = 10.0
"""Trigger level over the rms of the force at rest, if that is larger, chosen."""
MAX_TRIGGER_PEAK_SHARE = 0.5
"""Largest trigger level over the softest trial hit, chosen."""
FIRST_TRIGGER_RANGE_SHARE = 0.005
"""Smallest trigger level of the first trial hit over the range of the force, chosen."""
MIN_RANGE_SHARE, MAX_RANGE_SHARE = 0.02, 0.9
"""Shares of its range between which the peaks of a channel should stay, chosen."""
RANGE_HEADROOM = 2
"""Suggested range over the peaks of the hits, chosen."""
MAX_TRIAL_HITS = 3
"""Largest number of trial hits."""
CHANNEL_UNITS = {"force": "N", "acceleration": "m/s^2"}
_OVERLOAD_FLAGS = HitFlags.TOO_HARD | HitFlags.OVERLOAD_FORCE | HitFlags.OVERLOAD_RESPONSE
_RANGE_FLAGS = HitFlags.TOO_SOFT | _OVERLOAD_FLAGS
_USABLE_FLAGS = HitFlags.NOT_DECAYED | _RANGE_FLAGS
"""Flags that a trial hit may have: trial hits are there to find them."""


def trigger_from_setup(setup: TapTable, sample_rate: float) -> Trigger | None:
    """Return the trigger settings of machine.toml, None if one is open."""
    if setup.trigger_n is None or setup.record_s is None:
        return None
    return Trigger(setup.trigger_n, round(setup.record_s * sample_rate), round(setup.pre_trigger_s * sample_rate))


class TrialHits:
    """Trial hits so far, and the settings they give."""

    def __init__(self, setup: TapTable, baseline: Hit) -> None:
        """Begin without hits. baseline: a record at rest."""
        self._setup, self._baseline = setup, baseline
        self._hits: list[Hit] = []
        self._in_range: list[Hit] = []
        """Those within both input ranges. Only they show how hard the next ones will be."""
        self._offset = float(np.mean(baseline.acceleration)) if setup.quantity == "acceleration" else 0.0
        """Value at rest from which the trigger level counts. The acceleration may include gravity."""
        self._record = setup.record_s or MIN_RECORD_TIME

    @property
    def trigger(self) -> Trigger:
        """Trigger settings known so far."""
        rate = self._baseline.sample_rate
        samples = round(self._record * rate)
        before, quantity = round(self._setup.pre_trigger_s * rate), self._setup.quantity
        return Trigger(self._level(), samples, before, quantity=quantity, offset=self._offset)

    @property
    def is_done(self) -> bool:
        """True if nothing is open: two hits of the chosen length, or three."""
        length = self.trigger.n_samples
        return len(self._hits) >= MAX_TRIAL_HITS or sum(hit.acceleration.size == length for hit in self._hits) >= 2

    @property
    def text(self) -> str:
        """Sentence on what to do. When done, on what was chosen and which range to choose."""
        if not self.is_done:
            return f"Trial hit {len(self._hits) + 1} sets the trigger level and the record length, but does not count."
        slowest = max(estimate_decay_time(hit) for hit in self._hits)
        level = f"{self.trigger.level:.3g} {CHANNEL_UNITS[self._setup.quantity]}"
        record = f"record length {self._record:g} s, {_format_time_constants(self._record, slowest)}"
        return join_sentences(f"Trigger level {level}, {record}", *map(str, self.remarks))

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """Remark on each channel whose range does not fit the trial hits."""
        channels = self._hits[0].channels or () if self._hits else ()
        remarks = (_range_remark(self._hits, i, channel) for i, channel in enumerate(channels))
        return tuple(remark for remark in remarks if remark is not None)

    def add(self, hit: Hit) -> HitFlags:
        """Add a trial hit and return why it is unusable, falsy if it is usable."""
        found = check_hit(hit)
        flags = found & ~_USABLE_FLAGS
        if flags:
            return flags
        needed = self._setup.pre_trigger_s + RECORD_TIME_CONSTANTS * estimate_decay_time(hit)
        steps = math.ceil(min(needed, MAX_RECORD_TIME) / RECORD_TIME_STEP - 1e-9)
        self._hits.append(hit)
        self._in_range += [] if found & _OVERLOAD_FLAGS else [hit]
        if self._setup.record_s is None:
            self._record = max(self._record, MIN_RECORD_TIME, RECORD_TIME_STEP * steps)
        return flags

    def _level(self) -> float:
        if self._setup.trigger_n is not None:
            return self._setup.trigger_n
        noise = TRIGGER_NOISE_RATIO * float(np.std(self._baseline.signals[0]))
        if not self._in_range:
            channels = self._baseline.channels
            return max(noise, FIRST_TRIGGER_RANGE_SHARE * (_get_full_scale(channels[0]) if channels else math.inf))
        signals = [hit.force if hit.has_force else np.abs(hit.acceleration - self._offset) for hit in self._in_range]
        peaks = [float(np.max(signal)) for signal in signals]
        level = min(max(TRIGGER_PEAK_SHARE * float(np.median(peaks)), noise), MAX_TRIGGER_PEAK_SHARE * min(peaks))
        return float(f"{level:.2g}")


def _format_time_constants(record: float, time_constant: float) -> str:
    if not math.isfinite(time_constant):
        return "the response does not decay (spindle running?)"
    count = record / max(time_constant, 1e-6)
    short = "" if count >= RECORD_TIME_CONSTANTS else f", fewer than the {RECORD_TIME_CONSTANTS} needed"
    return f"{min(count, 99):.0f} time constants of the slowest mode{short}"


def _get_full_scale(channel: Channel) -> float:
    return channel.full_scale / abs(channel.sensitivity)


def _range_remark(hits: Sequence[Hit], number: int, channel: Channel) -> Remark | None:
    name, unit = channel.quantity, CHANNEL_UNITS[channel.quantity]
    peaks = [float(np.max(np.abs(hit.signals[number]))) for hit in hits]
    full = _get_full_scale(channel)
    share = max(peaks) / full
    if MIN_RANGE_SHARE <= share <= MAX_RANGE_SHARE:
        return None
    too_large, percent = share < MIN_RANGE_SHARE, float(f"{100 * share:.2g}")
    wanted = RANGE_HEADROOM * (float(np.median(peaks)) if too_large else max(peaks))
    text = f"hits reach {percent:g} % of the range of {full:.3g} {unit}"
    cure = f"Choose a range or a sensor for about {wanted:.2g} {unit}"
    alternative = "" if too_large else ", or hit softer"
    return Remark("range-too-large" if too_large else "range-too-small", name, text, cure + alternative)
