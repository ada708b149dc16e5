"""One hammer hit: what was recorded and what is wrong with it."""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from acquisition.channel import Channel

LARGEST = 1e50
"""Largest size of a value in SI units: no measurement is larger, and powers of larger ones may be infinite."""


class HitFlags(enum.Flag):
    """Why a hit is refused; falsy when all is well. `str()` gives words with the cure.

    >>> flags = HitFlags.DOUBLE_HIT | HitFlags.OVERLOAD_FORCE
    >>> flags.words
    'double hit, overload (force)'
    >>> HitFlags.from_words("double hit") in flags, bool(HitFlags.OK)
    (True, False)
    """

    OK = 0
    """Nothing is wrong."""
    DOUBLE_HIT = enum.auto()
    """The hammer has touched twice."""
    OVERLOAD_FORCE = enum.auto()
    """The force stands at a rail of its converter."""
    OVERLOAD_RESPONSE = enum.auto()
    """The response stands at a rail of its converter."""
    TOO_SOFT = enum.auto()
    """The peak of the force is near the noise, or below 2 % of its range."""
    NOT_DECAYED = enum.auto()
    """The response still rings when the record ends."""
    LOST_SCANS = enum.auto()
    """Scans are missing inside the record."""
    NO_HIT = enum.auto()
    """No pulse stands out of the noise."""
    SWAPPED_CHANNELS = enum.auto()
    """The pulse is on the channel of the response."""
    TOO_HARD = enum.auto()
    """The peak of the force is above 90 % of its range, not clipped."""
    NARROW_BAND = enum.auto()
    """The force does not reach to the end of the band that is followed."""
    INCONSISTENT = enum.auto()
    """The FRF of this hit is not that of the good ones."""
    UNDONE = enum.auto()
    """The operator has taken it back."""
    NOT_JUDGED = enum.auto()
    """It could not be judged."""

    @property
    def words(self) -> str:
        """The verdict alone, e.g. "double hit, overload (force)"."""
        return ", ".join(_WORDS[flag][0] for flag in self) or "good"

    @property
    def cure(self) -> str:
        """What to do about it, a sentence a fault; empty when all is well."""
        return " ".join(_WORDS[flag][1] for flag in self)

    @classmethod
    def from_words(cls, words: str) -> HitFlags:
        """The flags whose `words` these are; ValueError for unknown ones."""
        by_words = {verdict: flag for flag, (verdict, _) in _WORDS.items()}
        flags = cls.OK
        for word in filter(None, words.removeprefix("good").split(", ")):
            if word not in by_words:
                raise ValueError(f"{word!r} is no hit verdict; known are {', '.join(by_words)}")
            flags |= by_words[word]
        return flags

    def __str__(self) -> str:
        """Verdict and cure in words."""
        return " ".join(f"{word}: {cure}" for word, cure in (_WORDS[flag] for flag in self)) or "good"


_WORDS: Mapping[HitFlags, tuple[str, str]] = {
    HitFlags.DOUBLE_HIT: ("double hit", "Let the hammer bounce back after the first touch."),
    HitFlags.OVERLOAD_FORCE: ("overload (force)", "Hit softer or choose a larger force range."),
    HitFlags.OVERLOAD_RESPONSE: ("overload (response)", "Hit softer or choose a larger acceleration range."),
    HitFlags.TOO_SOFT: ("too soft", "Hit harder."),
    HitFlags.NOT_DECAYED: (
        "not decayed",
        "Use a longer record; wait until the tool is still before the next hit.",
    ),
    HitFlags.LOST_SCANS: (
        "lost scans",
        "Hit again; if it stays, lower the sample rate or use another cable.",
    ),
    HitFlags.NO_HIT: ("no hit", "Check the hammer cable and the trigger level."),
    HitFlags.SWAPPED_CHANNELS: ("swapped channels", "Swap the two cables."),
    HitFlags.TOO_HARD: ("too hard", "Hit softer or choose a larger force range."),
    HitFlags.NARROW_BAND: ("narrow band", "Use a harder hammer tip."),
    HitFlags.INCONSISTENT: ("inconsistent", "Hit the same spot in the same direction as before."),
    HitFlags.UNDONE: ("undone", "Taken back by the operator."),
    HitFlags.NOT_JUDGED: ("not judged", "Hit again; if it stays, check both sensors and their cables."),
}


def flaw(value: complex) -> str:
    """What is wrong with a value that is not within LARGEST."""
    return f"larger than {LARGEST:g}" if np.isfinite(value) else "not finite"


@dataclass(frozen=True, eq=False)
class Hit:
    """Force and response of one hammer hit on one time axis; the response alone where no force was measured.

    Raises ValueError where the records differ in length, are too short, or hold NaN, inf or values beyond 1e50.

    >>> time = np.arange(-100, 4000) / 10240.0
    >>> force = 200 * np.where((time >= 0) & (time <= 1e-3), np.sin(np.pi * time / 1e-3) ** 4, 0.0)  # N
    >>> structure = Structure(np.array([500.0]), np.array([0.02]), np.array([2e7]))
    >>> hit = Hit(force, 200 * structure.response(time, 1e-3), 10240.0, pre_trigger=100)
    >>> float(hit.time[100]), check_hit(hit) == HitFlags.OK
    (0.0, True)
    """

    force: NDArray[np.float64]
    """Hammer force (N), shape (n,); empty where no sensor measured it."""
    acceleration: NDArray[np.float64]
    """Response (m/s^2), shape (n,)."""
    sample_rate: float
    """Samples a second (Hz)."""
    pre_trigger: int = 0
    """Number of samples before the trigger."""
    lost_scans: int = 0
    """Scans missing inside the record."""
    channels: tuple[Channel, ...] | None = None
    """Force and response channel, or the response channel alone, where the hit came from a DAQ."""
    codes: NDArray[np.int32] | None = None
    """Raw ADC codes, a row a channel, force first; None where the recording has none."""
    overload: int = 0
    """Overloads that the device itself reports: bit 0 the force, bit 1 the response."""
    beside: Hit | None = None
    """The same blow as a second sensor felt it, across to the first; None where there is none."""

    def __post_init__(self) -> None:
        """Convert to arrays and check them."""
        for name in ("force", "acceleration"):
            values = np.asarray(getattr(self, name), dtype=np.float64)
            object.__setattr__(self, name, values)
            bad = np.flatnonzero(~(np.abs(values) <= LARGEST))
            if bad.size:
                raise ValueError(f"{name} is {flaw(values[bad[0]])} at {bad.size} samples, first at sample {bad[0]}")
        same = self.force.shape in (self.acceleration.shape, (0,))
        if not same or self.acceleration.ndim != 1 or self.acceleration.size < 8:
            raise ValueError(
                f"force {self.force.shape} and acceleration {self.acceleration.shape} "
                "must be 1-D records of equal length, at least 8 samples"
            )
        if not (np.isfinite(self.sample_rate) and self.sample_rate > 0):
            raise ValueError(f"sample_rate={self.sample_rate} Hz is not > 0")

    @classmethod
    def from_codes(
        cls,
        codes: ArrayLike,
        channels: tuple[Channel, ...],
        sample_rate: float,
        pre_trigger: int = 0,
        lost_scans: int = 0,
        overload: int = 0,
        beside: Hit | None = None,
    ) -> Hit:
        """A hit from ADC codes, a row a channel, force first, scaled by the sensitivities of its channels."""
        raw = np.asarray(codes, dtype=np.int32)
        force = raw[0] * channels[0].scale if len(channels) > 1 else np.empty(0)
        response = raw[-1] * channels[-1].scale
        return cls(force, response, sample_rate, pre_trigger, lost_scans, channels, raw, overload, beside)

    @property
    def has_force(self) -> bool:
        """Whether the force was measured."""
        return bool(self.force.size)

    @property
    def sensors(self) -> tuple[Channel, ...]:
        """Channels of all that felt the blow, that of the response last; empty where it came from no DAQ."""
        channels = self.channels or ()
        return channels if self.beside is None else (*channels[:1], *self.beside.sensors[-1:], *channels[-1:])

    @property
    def signals(self) -> NDArray[np.float64]:
        """All that was measured, a row a channel: force (N) first, acceleration (m/s^2) last."""
        return np.stack([self.force, self.acceleration] if self.has_force else [self.acceleration])

    @property
    def time(self) -> NDArray[np.float64]:
        """Time from the trigger (s), shape (n,)."""
        return (np.arange(self.acceleration.size) - self.pre_trigger) / self.sample_rate
