"""Simulated hits whose faults are known, through the converter, the stream and the trigger of a real tap test.

A session is one hammer tip, one kind of noise, one set of channels and one structure: a handful of good hits that make
its mean, then hits of every kind. Two settings: SET, and HOLD_OUT with another structure, sample rate and
record. Nothing in the judging was chosen on HOLD_OUT,
except that errors in touches and swapped channels were found on hits of other seeds of both.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from acquisition import (
    Block,
    Channel,
    Frf,
    Hit,
    HitFlags,
    SimulatedSource,
    Source,
    Structure,
    Trigger,
    capture_hits,
    estimate_frf,
)

Signal = NDArray[np.float64]
FORCE_RANGE = 2200.0
"""Range of the hammer (N)."""
BACKGROUNDS = ("quiet", "5 N rms", "drift", "hum")
FALL = 0.157
"""Share of the foot of sin^4 that lies below 5 % of its peak, on either side."""


@dataclass(frozen=True, eq=False)
class Setting:
    """Tapped structure and its recording."""

    structure: Structure
    sample_rate: float
    record: int
    """Samples."""
    pre_trigger: int
    """Samples."""


SET = Setting(
    Structure(np.array([900.0, 1722.0, 3000.0]), np.array([0.03, 0.029, 0.02]), np.array([8e7, 3.2e7, 1e8]), 1e-9),
    25600.0,
    6400,
    512,
)
HOLD_OUT = Setting(
    Structure(
        np.array([450.0, 1130.0, 2480.0, 4200.0]),
        np.array([0.02, 0.015, 0.03, 0.02]),
        np.array([4e7, 9e7, 2.5e7, 1.5e8]),
        2e-9,
    ),
    51200.0,
    20480,
    1280,
)


@dataclass(frozen=True)
class Blow:
    """One pulse A sin^4(pi t/T)."""

    peak: float
    """A (N)."""
    width: float
    """T (s)."""
    start: float = 0.0
    """After that of the first (s)."""


@dataclass(frozen=True, eq=False)
class LabelledHit:
    """A hit and its true label."""

    kind: str
    hit: Hit
    expected: HitFlags
    """The flag that must be there; OK for a good hit."""
    mean: Frf
    """Mean of the good hits of its session."""


@dataclass(frozen=True, eq=False)
class Session:
    """One tip, one noise, one set of channels."""

    setting: Setting
    random: np.random.Generator
    background: str
    width: float
    """T of the tip (s)."""
    force_noise: float
    """rms of everything but drift (N)."""
    response_noise: float
    """rms (m/s^2)."""
    channels: tuple[Channel, Channel]

    def blow(self, low: float = 1.0, high: float = 1.0) -> Blow:
        """A good blow; peak within these shares of the usual one, which stays clear of too soft and too hard."""
        least = max(1.3 * 20 * self.force_noise, 1.3 * 0.02 * FORCE_RANGE)
        peak = self.random.uniform(least, max(4 * least, 400.0)) * self.random.uniform(low, high)
        return Blow(min(peak, 0.75 * FORCE_RANGE), self.width * self.random.uniform(0.85, 1.15))

    def signal(self, blows: Sequence[Blow], structure: Structure, gain: float = 1.0) -> Signal:
        """Force and response without noise, shape (2, n); the first pulse stands after 1.5 pre-triggers."""
        setting = self.setting
        n = int(2 * setting.pre_trigger + setting.record * 1.2)
        time = (np.arange(n) - 1.5 * setting.pre_trigger - self.random.uniform()) / setting.sample_rate
        clean = np.zeros((2, n))
        for blow in blows:
            t = time - blow.start
            clean[0] += np.where((t >= 0) & (t <= blow.width), blow.peak * np.sin(np.pi * t / blow.width) ** 4, 0.0)
            clean[1] += gain * blow.peak * structure.response(t, blow.width)
        return clean

    def noise(self, n: int) -> Signal:
        """Noise, drift and hum, shape (2, n)."""
        time = np.arange(n) / self.setting.sample_rate
        white = 1 / np.sqrt(2) if self.background == "hum" else 1.0
        levels = np.array([[self.force_noise], [self.response_noise]])
        result: Signal = self.random.normal(size=(2, n)) * levels * white
        if self.background == "drift":
            u = time / time[-1]
            offset, slope, bend = self.random.uniform(-10, 10, 3)
            result[0] += offset + slope * u + bend * u**2
        if self.background == "hum":
            mains, phase = 2 * np.pi * self.random.choice([49.9, 50.0, 60.0]), self.random.uniform(0, 2 * np.pi, 2)
            result += levels * (np.sin(mains * time + phase[0]) + 0.2 * np.sin(3 * mains * time + phase[1]))
        return result

    def take(
        self,
        signal: Signal,
        channels: tuple[Channel, Channel] | None = None,
        gap: int = 0,
    ) -> Hit:
        """The hit that the trigger cuts from this signal; `gap` scans lost soon after the pulse."""
        setting, pair = self.setting, channels or self.channels
        highest = min(float(signal[0].max()), pair[0].full_scale / pair[0].sensitivity)
        trigger = Trigger(0.5 * highest, setting.record, setting.pre_trigger, hysteresis=1.0)
        cut = int(2.5 * setting.pre_trigger)
        rate = setting.sample_rate
        stream: Source = SimulatedSource(
            lambda first, count: signal[:, first : first + count], pair, rate, signal.shape[1]
        )
        if gap:
            stream = Lossy(stream, cut, gap)
        return next(iter(capture_hits(stream, trigger)))


@dataclass
class Lossy:
    """A source some of whose scans never arrive."""

    source: Source
    at: int
    gap: int

    @property
    def channels(self) -> tuple[Channel, ...]:
        return self.source.channels

    @property
    def sample_rate(self) -> float:
        return self.source.sample_rate

    def start(self) -> None: ...

    def stop(self) -> None: ...

    def blocks(self) -> Iterator[Block]:
        for block in self.source.blocks():
            low, high = (
                int(np.clip(at - block.first_scan, 0, block.codes.shape[1])) for at in (self.at, self.at + self.gap)
            )
            if low == high:
                yield block
                continue
            yield Block(block.first_scan, block.codes[:, :low])
            yield Block(block.first_scan + high, block.codes[:, high:], lost_before=high - low)


def session(setting: Setting, random: np.random.Generator, number: int) -> Session:
    """A session; tips of 0.3 to 1 ms and soft ones of 1 to 4 ms in turn, every background in turn."""
    background = BACKGROUNDS[number % len(BACKGROUNDS)]
    soft = number // len(BACKGROUNDS) % 2
    width = np.exp(random.uniform(*np.log((1e-3, 4e-3) if soft else (0.3e-3, 1e-3))))
    force_noise = {"quiet": 0.05, "5 N rms": 5.0, "drift": random.uniform(0.1, 1.0), "hum": random.uniform(1, 4)}[
        background
    ]
    force = Channel("force", 2.2e-3, 2.2e-3 * FORCE_RANGE)
    response = Channel("acceleration", 1e-3, 1.0)
    room = Session(setting, random, background, width, force_noise, 0.0, (force, response))
    largest = max(float(np.abs(room.signal([room.blow()], setting.structure)[1]).max()) for _ in range(10))
    return replace(
        room,
        response_noise=largest * random.uniform(2e-4, 2e-3),
        channels=(force, replace(response, full_scale=1e-3 * largest * random.uniform(2, 6))),
    )


def good(one: Session) -> Hit:
    """A hit of a steady hand: up to 10 degrees off the direction, up to 3 % in the mode shapes from the spot."""
    structure = one.setting.structure
    spot = one.random.uniform(0.97, 1.03, structure.frequency.size)
    gain = np.cos(np.radians(one.random.uniform(-10, 10)))
    clean = one.signal([one.blow()], replace(structure, stiffness=structure.stiffness * spot), gain)
    return one.take(clean + one.noise(clean.shape[1]))


def double(one: Session) -> Hit:
    """Two touches equal within 10 %, at least a pulse width apart: they cancel somewhere in the band."""
    first = one.blow()
    room = 0.8 * one.setting.record / one.setting.sample_rate
    gap = np.exp(one.random.uniform(0, np.log(room / first.width)))
    second = second_blow(one, first, one.random.uniform(0.9, 1.1), gap)
    clean = one.signal([first, second], one.setting.structure)
    return one.take(clean + one.noise(clean.shape[1]))


def touched(one: Session) -> Hit:
    """A further touch of 3 to 30 %, from a pulse width to 20 ms after the first or as far before it."""
    first = one.blow()
    share = np.exp(one.random.uniform(np.log(0.03), np.log(0.3)))
    before = 0.7 * one.setting.pre_trigger / one.setting.sample_rate - 2 * first.width
    early = one.random.uniform() < 0.3 and before > 2 * first.width
    longest = min(before, 20e-3) if early else max(20e-3, 2 * first.width)
    gap = np.exp(one.random.uniform(0, np.log(longest / first.width)))
    clean = one.signal([first, second_blow(one, first, share, gap, early=early)], one.setting.structure)
    return one.take(clean + one.noise(clean.shape[1]))


def touched_late(one: Session) -> Hit:
    """A further touch of 20 to 60 % whose response has 5 to 50 % of the loudest of the record at its end."""
    structure, setting = one.setting.structure, one.setting
    slowest = 2 * np.pi * np.min(structure.frequency * structure.damping_ratio)
    while True:
        first, share = one.blow(), one.random.uniform(0.2, 0.6)
        start = (setting.record - setting.pre_trigger) / setting.sample_rate - one.random.uniform(0, 3) / slowest
        clean = one.signal([first, replace(first, peak=share * first.peak, start=start)], structure)
        end = int(1.5 * setting.pre_trigger) + setting.record - setting.pre_trigger
        tenths = [float(np.std(part)) for part in np.array_split(clean[1, end - setting.record : end], 10)]
        left = float(np.std(clean[1, end - setting.record // 50 : end]))
        if left > max(0.05 * max(tenths), 4 * one.response_noise):
            return one.take(clean + one.noise(clean.shape[1]))


def second_blow(one: Session, first: Blow, share: float, gap: float, *, early: bool = False) -> Blow:
    """A further touch whose 5 % level stands `gap` widths (at the 5 % level) from that of the first."""
    width = first.width * one.random.uniform(0.8, 1.8)
    pause = gap * (1 - 2 * FALL) * first.width
    if early:
        return Blow(share * first.peak, width, -(width * (1 - FALL) + pause - first.width * FALL))
    return Blow(share * first.peak, width, first.width * (1 - FALL) + pause - width * FALL)


def _clipped(index: int, *, amplifier: bool, codes: bool = True) -> Callable[[Session], Hit]:
    """Cut off at 40 to 90 % of what it would be, by the converter or by the amplifier before it."""

    shortest = (1.5e-3 if amplifier else 0.6e-3) if index == 0 else 0.0

    def make(one: Session) -> Hit:
        while True:
            blow = one.blow()
            blow = replace(blow, width=max(blow.width, shortest))
            clean = one.signal([blow], one.setting.structure)
            level = float(np.abs(clean[index]).max() * one.random.uniform(0.4, 0.9))
            cut = max(np.count_nonzero(sign * clean[index] > level) for sign in (1, -1))
            noise = one.noise(clean.shape[1])
            if cut >= (8 if amplifier else 4) and level > 30 * np.std(noise[index]):
                break
        pair = list(one.channels)
        if amplifier:
            signal = clean + noise
            noise_on_top = level * one.random.choice([0.0, 1e-6, 1e-4, 2e-3]) * one.random.normal(size=clean.shape[1])
            signal[index] = np.clip(signal[index], -level, level) + noise_on_top
        else:
            signal = clean + noise
            pair[index] = replace(pair[index], full_scale=level * pair[index].sensitivity)
        hit = one.take(signal, (pair[0], pair[1]))
        return hit if codes else Hit(hit.force, hit.acceleration, hit.sample_rate, hit.pre_trigger)

    return make


def not_decayed(one: Session) -> Hit:
    """Modes whose decay outlasts the record, which holds 1 to 2.5 time constants."""
    setting = one.setting
    while True:
        blow = replace(one.blow(), width=one.random.uniform(0.3e-3, 0.8e-3))
        tau = (setting.record - setting.pre_trigger) / setting.sample_rate / one.random.uniform(1, 2.5)
        zeta = 1 / (2 * np.pi * setting.structure.frequency * tau)
        clean = one.signal([blow], replace(setting.structure, damping_ratio=zeta))
        end = int(1.5 * setting.pre_trigger) + setting.record - setting.pre_trigger
        tenths = [float(np.std(part)) for part in np.array_split(clean[1, end - setting.record : end], 10)]
        if tenths[-1] > max(0.03 * max(tenths), 4 * one.response_noise):
            break
    channels = (one.channels[0], replace(one.channels[1], full_scale=2e-3 * float(np.abs(clean[1]).max())))
    return one.take(clean + one.noise(clean.shape[1]), channels)


def too_soft(one: Session) -> Hit:
    """60 to 85 % of what would do."""
    limit = max(20 * one.force_noise, 0.02 * FORCE_RANGE)
    blow = replace(one.blow(), peak=limit * one.random.uniform(0.6, 0.85))
    clean = one.signal([blow], one.setting.structure)
    return one.take(clean + one.noise(clean.shape[1]))


def lost(one: Session) -> Hit:
    """1 to 64 scans missing."""
    clean = one.signal([one.blow()], one.setting.structure)
    return one.take(clean + one.noise(clean.shape[1]), gap=int(one.random.integers(1, 65)))


def swapped(one: Session) -> Hit:
    """The cables of hammer and accelerometer exchanged: each voltage is read with the other's sensitivity."""
    clean = one.signal([one.blow()], one.setting.structure)
    noisy = clean + one.noise(clean.shape[1])
    ratio = one.channels[1].sensitivity / one.channels[0].sensitivity
    scale = np.array([[ratio], [1 / ratio]])
    wide = tuple(
        replace(c, full_scale=2 * c.sensitivity * float(np.abs(s).max()))
        for c, s in zip(one.channels, noisy[::-1] * scale, strict=True)
    )
    return one.take(noisy[::-1] * scale, (wide[0], wide[1]))


def other_spot(one: Session) -> Hit:
    """Another spot: every mode is seen with 1/3 to 0.6 or with 1.6 to 3 times its stiffness."""
    structure = one.setting.structure
    factor = np.exp(one.random.choice([-1, 1]) * one.random.uniform(np.log(1.6), np.log(3), structure.frequency.size))
    clean = one.signal([one.blow()], replace(structure, stiffness=structure.stiffness * factor))
    return one.take(clean + one.noise(clean.shape[1]), _wide(one, clean))


def other_direction(one: Session) -> Hit:
    """Across instead of along (other modes), or from the other side (the sign)."""
    structure, sign = one.setting.structure, 1.0
    if one.random.uniform() < 0.5:
        sign = -1.0
    else:
        shift = one.random.choice([-1, 1]) * one.random.uniform(0.08, 0.2)
        factor = one.random.uniform(1.6, 2.5)
        structure = replace(
            structure, frequency=structure.frequency * (1 + shift), stiffness=structure.stiffness * factor
        )
    clean = one.signal([one.blow()], structure, sign)
    return one.take(clean + one.noise(clean.shape[1]), _wide(one, clean))


def _wide(one: Session, clean: Signal) -> tuple[Channel, Channel]:
    return one.channels[0], replace(one.channels[1], full_scale=3e-3 * float(np.abs(clean[1]).max()))


Kinds = dict[str, tuple[Callable[[Session], Hit], HitFlags, int]]

KINDS: Kinds = {
    "good": (good, HitFlags.OK, 10),
    "double hit": (double, HitFlags.DOUBLE_HIT, 8),
    "force clipped by the converter": (_clipped(0, amplifier=False), HitFlags.OVERLOAD_FORCE, 1),
    "response clipped by the converter": (_clipped(1, amplifier=False), HitFlags.OVERLOAD_RESPONSE, 1),
    "force clipped before it, noise on top": (_clipped(0, amplifier=True), HitFlags.OVERLOAD_FORCE, 1),
    "response clipped before it, noise on top": (_clipped(1, amplifier=True), HitFlags.OVERLOAD_RESPONSE, 1),
    "clipped, recording without codes": (_clipped(0, amplifier=False, codes=False), HitFlags.OVERLOAD_FORCE, 1),
    "not decayed": (not_decayed, HitFlags.NOT_DECAYED, 1),
    "too soft": (too_soft, HitFlags.TOO_SOFT, 1),
    "missing scans": (lost, HitFlags.LOST_SCANS, 1),
    "swapped channels": (swapped, HitFlags.SWAPPED_CHANNELS, 1),
    "other spot": (other_spot, HitFlags.INCONSISTENT, 1),
    "other direction": (other_direction, HitFlags.INCONSISTENT, 1),
}
"""By kind: how one is made, the flag that it must get, how many a session."""
TOUCHES: Kinds = {
    "further touch": (touched, HitFlags.OK, 8),
    "touch at the end": (touched_late, HitFlags.DOUBLE_HIT | HitFlags.NOT_DECAYED, 2),
}
"""Kinds of further touches: harmless ones, and those whose response the record does not hold (either flag will do)."""


def labelled_hits(setting: Setting, sessions: int, seed: int, kinds: Kinds = KINDS) -> Iterator[LabelledHit]:
    """The hits of so many sessions, 29 each of KINDS."""
    for number, random in enumerate(np.random.default_rng(seed).spawn(sessions)):
        one = session(setting, random, number)
        mean = estimate_frf([good(one) for _ in range(int(random.integers(3, 8)))])
        for kind, (make, expected, count) in kinds.items():
            for _ in range(count):
                yield LabelledHit(kind, make(one), expected, mean)
