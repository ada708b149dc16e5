"""Accuracy of chatter detection on cuts of an independent simulation: verdict, frequency, speed.

Truth: what the tip itself does in the simulation. Run-out keeps teeth out of the cut, so that the limit by
semi-discretisation, from which depths are drawn, is not that of the simulation: a cut is near its own limit, and left
out, where it does not do the same 10 % less and more deep. Words are held against the other limit too.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition.emulation import (
    MillingCut,
    Passage,
    Structure,
    TipMotion,
    make_random_housing,
    sample_housing,
    simulate_cuts,
)
from lobes import Cut, stability_boundary
from lobewatch.cuts.chatter_detection.cut_evaluation import CutEvaluation, CutRecording, evaluate_recording
from lobewatch.cuts.chatter_detection.spectrum import sideband_distance
from modal import Mode

PASSAGE = Passage(before=0.4, ramp=0.05, steady=1.05, after=0.2)
CUTS, AIR = 500, 200
CHATTERS = 1e-2
"""Share of the displacement beside the turns of the spindle from which on the simulation itself chatters."""
LOCKED = 5.0
"""Displacement per depth, over that at 0.4 of the limit, from which on chatter has locked to the turns."""
NEAR = (1 / 1.1, 1 / 0.9)
"""Depths beside that of the cut where it must do the same, relative."""
SHARES = 4
"""Depths at which each cut is simulated."""
RIGHT, RIGHT_BY_LIMIT, NOT_TOLD = 0.98, 0.97, 0.05
"""Shares of right verdicts by the tip and by the limit, and of none; most cuts wrong by the limit do not chatter."""
Random = np.random.Generator


@dataclass
class Case:
    """A cut and its truth."""

    cut: Cut
    x: list[Mode]
    y: list[Mode]
    speed_rpm: float
    share: float
    limit: float
    kind: str
    feed: float
    runout: tuple[float, ...]

    @property
    def shares(self) -> tuple[float, ...]:
        """Simulated depths over the limit: its own, its neighbours, and a stable one."""
        return (self.share, *(self.share * near for near in NEAR), 0.4)

    def milled(self, share: float) -> MillingCut:
        """For the simulation."""
        angles = self.cut.entry_angle, self.cut.exit_angle
        force = self.cut.tangential, self.cut.radial
        x, y = structure(self.x), structure(self.y)
        depth = share * self.limit
        return MillingCut(
            self.cut.teeth, *angles, *force, depth, self.feed, self.speed_rpm, x=x, y=y, runout=self.runout
        )


class TipRecord(NamedTuple):
    """Motion of the tip in a cut."""

    frequency: float
    """Frequency of the loudest displacement that does not turn with the spindle (Hz)."""
    beside: float
    """Share of the energy of all displacement beside the turns of the spindle."""
    per_depth: float
    """Displacement over depth."""

    def chatters(self, quiet: TipRecord) -> bool:
        """Return whether the cut chatters, compared with a stable one."""
        return self.beside > CHATTERS or self.per_depth > LOCKED * quiet.per_depth


def structure(modes: list[Mode]) -> Structure:
    columns = [[mode.frequency, mode.damping_ratio, mode.stiffness] for mode in modes]
    frequency, damping, stiffness = np.array(columns).T
    return Structure(frequency, damping, stiffness)


def modes(random: Random) -> list[Mode]:
    count = int(random.integers(1, 3))
    frequencies = np.sort(random.uniform(500, 3500, count))
    return [Mode(float(f), random.uniform(0.01, 0.05), 10 ** random.uniform(6.8, 7.7)) for f in frequencies]


def cases(random: Random, count: int) -> Iterator[Case]:
    """1 to 6 teeth, all immersions, 3000 to 24 000 rpm, more than 10 % of depth from the limit, run-out 0 to 20 um."""
    while count:
        teeth, x, y = int(random.integers(1, 7)), modes(random), modes(random)
        immersion = [random.uniform(0.05, 0.3), random.uniform(0.3, 1.0), 1.0][int(random.integers(0, 3))]
        speed = 60 * random.uniform(100, 1600) / teeth
        tangential = random.uniform(5e8, 1.2e9)
        way = random.choice(["up", "down"])
        share = float(random.choice([random.uniform(0.4, 0.9), random.uniform(1.1, 1.8)]))
        cut = Cut(teeth, immersion, way, tangential, tangential * random.uniform(0.1, 0.6))
        runout = random.uniform(0, 20e-6) * np.cos(2 * np.pi * np.arange(teeth) / teeth + random.uniform(0, 6.28))
        feed = random.uniform(4e-5, 1.5e-4)
        if not 3000 <= speed <= 24000:
            continue
        try:
            boundary = stability_boundary(x, y, cut, [speed], 20e-3)
        except ArithmeticError:
            continue
        limit, island = float(boundary.crossings[0, 0]), [c for c in boundary.crossings[0, 1:2] if math.isfinite(c)]
        if not (math.isfinite(limit) and limit > 1e-4) or any(share * limit > c / 1.1 for c in island):
            continue
        count -= 1
        yield Case(cut, x, y, speed, share, limit, str(boundary.kind[0]), feed, tuple(runout) if teeth > 1 else (0.0,))


def tip_record(motion: TipMotion, turn: float, depth: float) -> TipRecord:
    """Record the motion of the tip; `turn` in Hz."""
    rate = motion.sample_rate
    first = round((PASSAGE.before + PASSAGE.ramp + 0.3 * PASSAGE.steady) * rate)
    last = round((PASSAGE.before + PASSAGE.ramp + PASSAGE.steady) * rate)
    part = motion.acceleration[:, first:last] * np.blackman(last - first)
    frequency = np.fft.rfftfreq(last - first, 1 / rate)
    power = np.sum(np.abs(np.fft.rfft(part, axis=1)) ** 2, axis=0) / np.maximum(frequency, 50.0) ** 4
    power[frequency < 100] = 0.0
    away = np.abs(frequency / turn - np.round(frequency / turn)) * turn
    beside = np.where(away > 4 * rate / (last - first), power, 0.0)
    total = float(np.sum(power))
    return TipRecord(float(frequency[np.argmax(beside)]), float(np.sum(beside)) / total, math.sqrt(total) / depth)


def listen(signal: NDArray[Any], case: Case, rate: float, random: Random) -> CutEvaluation:
    commanded = case.speed_rpm * (1 + random.uniform(-0.015, 0.015))
    (heard,) = evaluate_recording(CutRecording(signal, rate, case.cut.teeth, case.cut.immersion, commanded))
    return heard


@dataclass
class Tally:
    """Counts of right verdicts."""

    words: Counter[str] = field(default_factory=Counter)
    """Count by the motion of the tip: right, wrong, unclassified, near the limit."""
    by_limit: Counter[str] = field(default_factory=Counter)
    """By the limit of semi-discretisation; flips of even numbers of teeth apart."""
    speeds: list[float] = field(default_factory=list)
    """Relative errors of the speed."""
    frequencies: list[float] = field(default_factory=list)
    """Relative errors of the chatter frequency modulo tooth passing."""

    def add(self, case: Case, heard: CutEvaluation, motions: list[TipRecord]) -> None:
        """One more cut; motions: at each of its shares."""
        motion, *beside, quiet = motions
        chatters = motion.chatters(quiet)
        is_near = any(neighbour.chatters(quiet) != chatters for neighbour in beside)
        self.words["near" if is_near else _mark(heard, chatters)] += 1
        even = "even flip " if case.kind == "flip" and case.share > 1 and case.cut.teeth % 2 == 0 else ""
        self.by_limit[even + _mark(heard, case.share > 1)] += 1
        if heard.spindle_speed is not None:
            self.speeds.append(abs(heard.speed_rpm / case.speed_rpm - 1))
        if heard.chatter is not None and motion.beside > CHATTERS:
            tooth = case.speed_rpm / 60 * case.cut.teeth
            self.frequencies.append(
                float(sideband_distance(heard.chatter.frequency, motion.frequency, tooth)) / motion.frequency
            )


def _mark(heard: CutEvaluation, chatters: bool) -> str:
    if heard.verdict == "cannot tell":
        return "not told"
    return "right" if (heard.verdict != "stable") == chatters else "wrong"


def judge(seed: int, count: int, tally: Tally) -> None:
    """Simulate cuts, listen to them, and hold the words against the truth."""
    random = np.random.default_rng(seed)
    drawn = list(cases(random, count))
    places = [(case, share) for case in drawn for share in case.shares]
    motions: dict[int, TipRecord] = {}
    heard: dict[int, CutEvaluation] = {}
    for place, motion in simulate_cuts([case.milled(share) for case, share in places], PASSAGE):
        case, share = places[place]
        motions[place] = tip_record(motion, case.speed_rpm / 60, share * case.limit)
        if place % SHARES == 0:
            noise = np.random.default_rng((seed, place))
            rate = float(noise.choice([25600.0, 51200.0]))
            signal = sample_housing(motion, make_random_housing(noise, case.speed_rpm), case.speed_rpm, rate, noise)
            heard[place] = listen(signal, case, rate, noise)
    for place, sound in heard.items():
        tally.add(places[place][0], sound, [motions[place + number] for number in range(SHARES)])


def share_right(words: Counter[str]) -> float:
    """Return the share of right verdicts."""
    return words["right"] / (words["right"] + words["wrong"])


@pytest.mark.long
@pytest.mark.timeout(3600)
def test_simulated_cuts_are_reported_right() -> None:
    tally = Tally()
    for seed in range(200, 205):
        judge(seed, CUTS // 5, tally)
    words, speeds, frequencies = tally.words, np.array(tally.speeds), np.array(tally.frequencies)
    quantiles = np.quantile(speeds, [0.5, 0.95, 1.0])
    shares = np.mean(speeds < 5e-4), np.mean(frequencies < 3e-3)
    print(dict(words), dict(tally.by_limit), "speed", quantiles, shares[0], "frequency", frequencies.size, shares[1])  # noqa: T201  (for docs/studies/long-tests.md)
    assert share_right(words) >= RIGHT
    assert words["not told"] <= NOT_TOLD * (sum(words.values()) - words["near"])
    assert share_right(tally.by_limit) >= RIGHT_BY_LIMIT
    assert shares[0] >= 0.995
    assert shares[1] >= 0.97


@pytest.mark.long
def test_idle_runs_and_pumps_are_never_chatter() -> None:
    random, words = np.random.default_rng(5), Counter[str]()
    for number in range(AIR):
        speed, rate = random.uniform(3000, 24000), float(random.choice([25600.0, 51200.0]))
        housing = make_random_housing(random, speed)
        signal = sample_housing(TipMotion(60e3, np.zeros((2, 105_000))), housing, speed, rate, random)
        if number % 2:
            inside = slice(round(0.45 * rate), round(1.5 * rate))
            time = np.arange(inside.stop - inside.start) / rate
            signal[inside] += random.normal(scale=housing.noise * random.uniform(0, 3), size=time.size)
            for _ in range(int(random.integers(1, 6))):
                pump, loud = random.uniform(100, 6000), 10 ** random.uniform(-1, 0.8)
                signal[inside] += loud * np.sin(2 * np.pi * pump * time + random.uniform(0, 6.28))
        commanded = speed * (1 + random.uniform(-0.015, 0.015))
        teeth = int(random.integers(1, 7))
        heard = evaluate_recording(CutRecording(signal, rate, teeth, 1.0, commanded))
        words.update(f"{sound.verdict} {sound.reason}" for sound in heard)
    print(dict(words))  # noqa: T201
    assert not [word for word in words if not word.startswith("cannot tell")]
