"""Next speeds by sound on hidden spindles, whose cuts are simulated in the time domain.

Verdict and chatter frequency of each cut come from `acquisition.emulation.simulate_cuts` (chips, run-out, loss of
contact), the best depth from semi-discretization. Neither shares code with the lobes of `next_speed`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from learning_study import CHATTERS
from numpy.typing import NDArray
from turn_repetition import nonperiodic_share

from acquisition.emulation import MillingCut, Passage, Structure, TipMotion, simulate_cuts
from lobes import Cut, stability_boundary
from lobewatch.cuts.learning.next_speed import HeardCut, suggest_speeds
from modal import Mode

Floats = NDArray[np.float64]

PASSAGE = Passage(before=0.0, ramp=0.02, steady=0.6, after=0.0)
HIGHEST_RPM = (8000.0, 12000.0, 18000.0, 24000.0, 30000.0)
IMMERSIONS = (0.1, 0.25, 0.5, 0.75, 1.0)
N_SPEEDS, DEEPEST, MAX_CYCLES = 160, 0.2, 30.0
"""Speeds and largest depth (m) of the true limit, and most cycles of a mode in a tooth period."""
MIN_CONTRAST = 0.45
"""Lowest limit over the best depth, above which every speed would do."""
MAX_CONTRAST = 20.0
"""Best depth over the lowest limit, at most."""


@dataclass
class HiddenSpindle:
    """A spindle of one to three modes in each direction, its cutter of two to four flutes, and its cuts so far."""

    number: int
    seed: int
    share: tuple[float, float]
    """Range of the depth of the first cut over the best depth."""
    cuts: list[HeardCut] = field(default_factory=list)

    def __post_init__(self) -> None:
        draw = np.random.default_rng((77, self.seed, self.number))
        while not self._draw(draw):
            pass
        depth = self.best * _between(draw, *self.share)
        first = draw.choice(np.flatnonzero(self.limits < 0.95 * depth))
        self.next: tuple[float, float] | None = (float(self.speeds[first]), depth)

    def _draw(self, draw: np.random.Generator) -> bool:
        """Draw a spindle and a cut; False if all speeds would do, lobes are too close, or no limit is known."""
        f, k = _between(draw, 400, 3000), _between(draw, 5e6, 5e7)
        more = [(f * _between(draw, 0.4, 2.5), k * _between(draw, 1, 6)) for _ in range(draw.integers(0, 3))]
        x = [(frequency, draw.uniform(0.01, 0.05), stiffness) for frequency, stiffness in [(f, k), *more]]
        y = [
            (f * _between(draw, 0.9, 1.1), zeta * _between(draw, 0.7, 1.4), k * _between(draw, 0.7, 1.4))
            for f, zeta, k in x
        ]
        self.x, self.y = ([Mode(*mode) for mode in modes] for modes in (x, y))
        kt = draw.uniform(6e8, 2.2e9)
        kind = float(draw.choice(IMMERSIONS)), "up" if draw.uniform() < 0.5 else "down"
        self.cut = Cut(int(draw.integers(2, 5)), *kind, kt, kt * draw.uniform(0.1, 0.5))  # type: ignore[arg-type]
        high = float(draw.choice(HIGHEST_RPM))
        self.speeds = np.geomspace(high / draw.uniform(3, 6), high, N_SPEEDS)
        self.runout = tuple(draw.uniform(0, 1e-5, self.cut.teeth).tolist())
        if max(mode.frequency for mode in self.x) * 60 / (self.cut.teeth * self.speeds[0]) > MAX_CYCLES:
            return False
        try:
            limits = stability_boundary(self.x, self.y, self.cut, self.speeds, DEEPEST).depth
        except ArithmeticError:  # not converged at some speed
            return False
        self.limits = np.minimum(limits, DEEPEST)
        self.best = min(float(np.max(self.limits)), MAX_CONTRAST * float(np.min(self.limits)))
        return bool(np.min(self.limits) < MIN_CONTRAST * self.best)

    def milling(self) -> MillingCut:
        """Return the next cut as it is."""
        assert self.next is not None
        x, y = (
            Structure(*np.array([(m.frequency, m.damping_ratio, m.stiffness) for m in modes]).T)
            for modes in (self.x, self.y)
        )
        cut, (speed, depth) = self.cut, self.next
        force = cut.entry_angle, cut.exit_angle, cut.tangential, cut.radial
        return MillingCut(cut.teeth, *force, depth, 1e-4, speed, x, y, runout=self.runout)

    def hear(self, frequency: float) -> None:
        """Keep the next cut with its chatter frequency (Hz), NaN if stable, 0 if unknown, and plan another one."""
        assert self.next is not None
        speed, depth = self.next
        self.cuts.append(
            HeardCut(speed, "stable" if math.isnan(frequency) else "chatter", frequency or math.nan, depth)
        )
        found = suggest_speeds(self.cuts, self.cut.teeth, (float(self.speeds[0]), float(self.speeds[-1])))
        self.next = (found.speeds[0].speed_rpm, found.speeds[0].depth) if found.speeds else None

    def is_found(self, n_cuts: int) -> bool:
        """Return whether one of the first cuts was stable at a speed whose limit is at least half of the best depth."""
        stable = [cut.speed_rpm for cut in self.cuts[:n_cuts] if not cut.has_chatter]
        limits = np.interp(np.log(stable), np.log(self.speeds), self.limits) if stable else np.zeros(1)
        return bool(np.max(limits) >= self.best / 2)


def make_cuts(spindles: Sequence[HiddenSpindle], count: int) -> None:
    """Cut as suggested, all spindles side by side."""
    for _ in range(count):
        asked = [spindle for spindle in spindles if spindle.next is not None]
        cuts = [spindle.milling() for spindle in asked]
        for number, motion in simulate_cuts(cuts, PASSAGE):
            asked[number].hear(hear_motion(cuts[number], motion))


def hear_motion(cut: MillingCut, motion: TipMotion) -> float:
    """Return the loudest frequency (Hz) that does not repeat from turn to turn; NaN if stable, 0 after an overflow."""
    if not np.all(np.isfinite(motion.acceleration)):
        return 0.0
    if nonperiodic_share(motion, cut, PASSAGE) < CHATTERS:
        return math.nan
    turn = round(motion.sample_rate * cut.tooth_period * cut.teeth)
    steady = motion.acceleration[:, int(0.2 * motion.sample_rate) : int(0.62 * motion.sample_rate)]
    turns = steady[:, : steady.shape[1] // turn * turn].reshape(2, -1, turn)
    rest = (turns - np.mean(turns, axis=1, keepdims=True)).reshape(2, -1)
    count = 4 * rest.shape[1]
    power = np.sum(np.abs(np.fft.rfft(rest * np.hanning(rest.shape[1]), count)) ** 2, axis=0)
    return float(np.fft.rfftfreq(count, 1 / motion.sample_rate)[np.argmax(power)])


def _between(draw: np.random.Generator, low: float, high: float) -> float:
    return math.exp(draw.uniform(math.log(low), math.log(high)))
