"""Test cuts on spindles unlike the learning prior, evaluated by time-domain simulation.

Truths are drawn by other rules than those of `lobewatch.cuts.learning.prior_samples`; words and frequencies come from
`acquisition.emulation.simulate_cuts` (chips, run-out, loss of contact), the optimum from the textbook form of the lobes
of a slot (below): neither shares code with the learner.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from shown_power import FEED, ShownPower
from speed_grid import list_speeds
from turn_repetition import nonperiodic_share

from acquisition.emulation.hammered_structure import Structure
from acquisition.emulation.milling import simulate_cuts
from acquisition.emulation.milling_cut import MillingCut, Passage
from lobes import Cut, build_milling_system, rows_at_speeds
from lobewatch.cuts.learning.cut_likelihood import CutEvidence
from lobewatch.cuts.learning.drive_gain import assume_chatter
from lobewatch.cuts.learning.posterior import Posterior, build_prior, find_inconsistent_cuts
from lobewatch.cuts.learning.suggestion import CutGrid, find_cut_to_ask, suggest_cut
from lobewatch.verdicts.uncertainty import FactorRange, Uncertainty
from modal import Mode

Floats = NDArray[np.float64]
Modes = tuple[tuple[float, float, float], ...]
"""Frequency (Hz), damping ratio and stiffness (N/m) of each mode."""

CUTS = 5
TEETH = 4
LOW, HIGH, DEEPEST = 4000.0, 20000.0, 0.02
STEP = 5e-5
"""Depths are set in steps of this (m)."""
PASSAGE = Passage(before=0.0, ramp=0.02, steady=0.8, after=0.0)
CHATTERS = 0.05
"""Part of the motion that does not repeat from turn to turn (rms) from which a cut chatters."""
NOISE = 0.002
"""Relative error of a frequency that is heard."""
TANGENTIAL, RATIO = 8e8, 0.3
"""Kt (Pa) and Kr/Kt as machine.toml has them."""
CUT = Cut(TEETH, 1.0, "down", TANGENTIAL, RATIO * TANGENTIAL)


@dataclass
class ForeignTruth:
    """A spindle as it was tapped and as it is: only its softest mode is shifted, and the force differs."""

    number: int
    mislabelled: int = 0
    """Test cut that is written down as what it was not, from 1; 0 for none."""
    seed: int = 7
    """Seed of the truths: 7 for those that rules were chosen on, another for those they are measured on."""
    reads_power: bool = False
    """True if the power of each cut is read."""
    answers: bool = False
    """True if somebody looks a questioned stable cut up and answers rightly, without a cut."""
    cuts: list[CutEvidence] = field(default_factory=list)
    """Test cuts as they were written down."""
    truly_stable: list[bool] = field(default_factory=list)
    """True stability of each cut."""

    def __post_init__(self) -> None:
        draw = self.random = np.random.default_rng((34, self.seed, self.number))
        first, second = (self._tapped(draw, int(draw.integers(1, 3))) for _ in "xy")
        self.tapped = first, second
        softest = min((*first, *second), key=lambda mode: mode[1] * mode[2])
        shift, damped = draw.uniform(0.90, 1.03), draw.uniform(0.8, 1.3)
        self.x, self.y = (
            tuple((f * (shift if (f, zeta, k) == softest else 1.0), zeta * damped, k) for f, zeta, k in modes)
            for modes in self.tapped
        )
        self.tangential = TANGENTIAL * (0.72 if draw.uniform() < 0.5 else 1.35)
        self.radial = self.tangential * draw.uniform(0.1, 0.9)
        self.runout = tuple(draw.uniform(0, 2e-5, TEETH).tolist())
        self.speeds = list_speeds(LOW, HIGH)
        limits = slot_limits(self.x, self.y, self.tangential, self.radial, self.speeds)
        self.limits = np.minimum(limits, DEEPEST)
        depths = np.floor(self.limits / STEP + 1e-6) * STEP
        best = int(np.argmax(self.speeds * depths))
        self.optimum = float(self.speeds[best]), float(depths[best])
        self.learnt = self._before()
        self.drive = ShownPower(CUT, self.tangential, np.random.default_rng((35, self.seed, self.number)))

    def _before(self) -> Posterior:
        """Return the posterior before the first cut."""
        x, y = ([Mode(*mode) for mode in modes] for modes in self.tapped)
        count = len(x) + len(y)
        exact = {"tap": np.zeros((count, 4))}
        doubt = Uncertainty(
            exact, np.tile(np.eye(4), (count, 1, 1)), 0.01, FactorRange(0.8, 1.2), FactorRange(0.8, 1.2)
        )
        return build_prior(rows_at_speeds(build_milling_system(x, y), CUT, np.ones(1)), doubt)

    @staticmethod
    def _tapped(draw: np.random.Generator, count: int) -> Modes:
        """One or two modes, the second faster and stiffer."""
        f, zeta, k = draw.uniform(1000, 2200), draw.uniform(0.02, 0.04), draw.uniform(1.5e7, 3e7)
        return ((f, zeta, k), (f * draw.uniform(1.35, 2.2), zeta, k * draw.uniform(1.5, 4)))[:count]

    def answer(self) -> None:
        """Correct the questioned cut if it chattered, without its frequency."""
        asked = find_cut_to_ask(self.learnt, self.cuts)
        if asked is None or self.truly_stable[place := self.cuts.index(asked)]:
            return
        power = None if asked.power is None else assume_chatter(asked.power)
        self.cuts[place] = replace(asked, verdict="chatter", power=power)
        self.learnt = reduce(Posterior.learn_from, self.cuts, self._before())

    def suggested(self) -> tuple[float, float] | None:
        """Speed (rpm) and depth (m) of the next test cut."""
        if self.answers and self.cuts:
            self.answer()
        grid = CutGrid(CUT, (0.0,), self.speeds, np.full(self.speeds.shape, DEEPEST), np.ones(self.speeds.shape))
        doubted = [contradicting.cut for contradicting in find_inconsistent_cuts(self.learnt)] if self.cuts else []
        suggestion = suggest_cut(self.learnt, grid, self.cuts, CUTS - len(self.cuts), doubted)
        return None if suggestion is None else (suggestion.speed_rpm, suggestion.depth)

    def milling(self, speed_rpm: float, depth: float) -> MillingCut:
        """Return the true milling cut."""
        x, y = (Structure(*np.array(modes).T) for modes in (self.x, self.y))
        return MillingCut(
            TEETH, 0.0, math.pi, self.tangential, self.radial, depth, FEED, speed_rpm, x, y, runout=self.runout
        )

    def write_down(self, speed_rpm: float, depth: float, frequency: float) -> None:
        """Keep a test cut and what it sounded like, or what somebody took it for; frequency in Hz, NaN where stable."""
        truly = math.isnan(frequency)
        frequency *= 1 + NOISE * self.random.standard_normal()
        wrong = self.mislabelled == len(self.cuts) + 1
        if wrong:
            frequency = self.random.uniform(0.8, 1.3) * self.x[0][0] if truly and self.number % 2 else math.nan
        word: Literal["stable", "chatter"] = "stable" if truly != wrong else "chatter"
        name = f"c{len(self.cuts) + 1}"
        power = self.drive.says(speed_rpm, depth, truly, word == "chatter") if self.reads_power else None
        self.cuts.append(CutEvidence(CUT, speed_rpm, depth, word, frequency, id=name, power=power))
        self.learnt = self.learnt.learn_from(self.cuts[-1])
        self.truly_stable.append(truly)

    @property
    def knows_force(self) -> bool:
        """True if the 95 % interval of Kt contains the truth."""
        interval = self.learnt.intervals["tangential"]
        return interval.low <= self.tangential / TANGENTIAL <= interval.high

    @property
    def reached(self) -> float:
        """Largest removal rate of a cut that was stable and was written down so, over the optimum."""
        heard = [
            cut.speed_rpm * cut.depth
            for cut, truly in zip(self.cuts, self.truly_stable, strict=True)
            if truly and not cut.has_chatter
        ]
        return min(max(heard, default=0.0) / (self.optimum[0] * self.optimum[1]), 1.0)


def make_cuts(truths: Sequence[ForeignTruth], count: int = CUTS) -> None:
    """Cut as suggested, all spindles side by side."""
    for _ in range(count):
        asked = [(one, place) for one in truths if (place := one.suggested()) is not None]
        sounds = heard([one.milling(*place) for one, place in asked])
        for (one, place), frequency in zip(asked, sounds, strict=True):
            one.write_down(*place, frequency)


def heard(cuts: Sequence[MillingCut]) -> list[float]:
    """Chatter frequency (Hz) of cuts from their motion only; NaN for motion that repeats every turn."""
    sounds = [math.nan] * len(cuts)
    for number, motion in simulate_cuts(cuts, PASSAGE):
        if nonperiodic_share(motion, cuts[number], PASSAGE) < CHATTERS:
            continue
        turn = round(motion.sample_rate * cuts[number].tooth_period * TEETH)
        steady = motion.acceleration[:, int(motion.sample_rate * 0.4) : int(motion.sample_rate * 0.82)]
        turns = steady[:, : steady.shape[1] // turn * turn].reshape(2, -1, turn)
        left = (turns - np.mean(turns, axis=1, keepdims=True)).reshape(2, -1)
        frequencies = np.fft.rfftfreq(4 * left.shape[1], 1 / motion.sample_rate)
        power = np.sum(np.abs(np.fft.rfft(left * np.hanning(left.shape[1]), 4 * left.shape[1])) ** 2, axis=0)
        sounds[number] = float(frequencies[np.argmax(power)])
    return sounds


def slot_limits(x: Modes, y: Modes, tangential: float, radial: float, speeds: Floats) -> Floats:
    """Limits (m) of a slot of four teeth at speeds (rpm), lobe by lobe.

    b (1 - exp(-i psi)) = -1 / lambda with the eigenvalues lambda of N/4 [[Kr, Kt], [-Kt, Kr]] diag(Gx, Gy): the force
    of four teeth in a slot is the same at all angles. Source: Altintas, Manufacturing Automation, 2nd ed., ch. 4.8.
    """
    frequencies = [mode[0] for mode in (*x, *y)]
    f = np.linspace(0.6 * min(frequencies), 1.6 * max(frequencies), 12000)
    gx, gy = _receptance(f, x), _receptance(f, y)
    half = TEETH / 4 * radial * (gx + gy) / 2
    product = (TEETH / 4) ** 2 * (radial**2 + tangential**2) * gx * gy
    root = np.sqrt(half**2 - product)
    root[1:] *= np.cumprod(np.where(np.real(root[1:] * np.conj(root[:-1])) < 0, -1.0, 1.0))
    limits = np.full(speeds.shape, np.inf)
    for speed, depth in _lobes(f, (half + root, half - root), float(speeds[0])):
        np.minimum(limits, _lowest(speed, depth, speeds), out=limits)
    return limits


def _receptance(f: Floats, modes: Modes) -> NDArray[np.complex128]:
    """Displacement at the tip by a force (m/N) at frequencies (Hz)."""
    own, zeta, k = np.array(modes).T[..., np.newaxis]
    return np.asarray(np.sum(1 / (k * (1 - (f / own) ** 2 + 2j * zeta * f / own)), axis=0))


def _lobes(f: Floats, loops: Sequence[NDArray[np.complex128]], slowest: float) -> Iterator[tuple[Floats, Floats]]:
    """Speeds (rpm) and depths (m) along each lobe."""
    for loop in loops:
        stiffness = -1 / loop
        psi = 2 * np.arctan2(stiffness.real, stiffness.imag)
        with np.errstate(divide="ignore"):
            depth = np.where(stiffness.real > 0, stiffness.real / (1 - np.cos(psi)), np.inf)
        psi = np.mod(psi, 2 * np.pi)
        for lobe in range(math.ceil(f[-1] * 60 / (TEETH * slowest)) + 1):
            yield 60 * 2 * np.pi * f / (TEETH * (psi + 2 * np.pi * lobe)), depth


def _lowest(speed: Floats, depth: Floats, speeds: Floats) -> Floats:
    """Lowest depth of a curve at speeds, between its points, inf where it has none; the curve may turn back."""
    lowest = np.full(speeds.shape, np.inf)
    left, right = np.minimum(speed[1:], speed[:-1]), np.maximum(speed[1:], speed[:-1])
    good = np.isfinite(depth[1:]) & np.isfinite(depth[:-1]) & (right > left) & (right < 1.05 * left)
    first, last = np.searchsorted(speeds, left), np.searchsorted(speeds, right)
    for i in np.flatnonzero(good & (last > first)):
        for place in range(first[i], last[i]):
            share = (speeds[place] - speed[i]) / (speed[i + 1] - speed[i])
            lowest[place] = min(lowest[place], depth[i] + share * (depth[i + 1] - depth[i]))
    return lowest
