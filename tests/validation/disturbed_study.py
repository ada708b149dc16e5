"""Verdicts from tap tests whose spindle changed from hit to hit, on random machines.

Hits are made here with numpy, and judged by the simulation in the time domain: neither shares code with what made the
verdicts. A machine that met several states is as bad as the worst of them.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime

import milling_simulation
import numpy as np
from milling_simulation import Modes
from milling_steps import Floats
from random_milling import RandomMilling, random_case
from verdict_study import MACHINE, limit_mm, program

from acquisition import Circumstances, Hit, TapDirection, TapTest, check_hit, estimate_frf
from lobewatch.machine import ProgramTable
from lobewatch.measurement.tap_measurement import measure
from lobewatch.tool.assembly import Assembly, assemble
from lobewatch.verdicts.verdict import Stability, evaluate_program

RATE, SECONDS, OVERSAMPLING = 25600, 1.0, 2
"""Samples per second, length of a record (s), and factor at which it is made."""
N_HITS = 10
TIME = datetime(2026, 1, 1, tzinfo=UTC)
KINDS = ("drift", "two states", "softening", "in some hits")
FORCES = 150.0, 350.0
"""Peak forces (N)."""
N_OBLIQUE = 3
"""Feed directions between x and y in which a program that feeds along both is judged."""


@dataclass
class Counts:
    """Verdicts of a study."""

    words: Counter[Stability] = field(default_factory=Counter)
    """Number of programs by stability."""
    uncovered: int = 0
    """Tools whose modes do not cover their measurement."""
    wrong: int = 0
    """Programs called stable that chatter in a state that was met."""


@dataclass(frozen=True)
class Disturbed:
    """A machine in the state of each hit, and the peak force of each hit (N)."""

    states: tuple[RandomMilling, ...]
    forces: tuple[float, ...]

    @property
    def limit_mm(self) -> float:
        """Least of the limits of all states (mm)."""
        return min(limit_mm(state) for state in dict.fromkeys(self.states))


def disturb(milling: RandomMilling, kind: str, rng: np.random.Generator) -> Disturbed:
    """Draw ten hits of a machine: undisturbed, or disturbed in one of `KINDS`."""
    forces = rng.uniform(*FORCES, N_HITS)
    shift = milling.x[0][1] * rng.uniform(0.3, 2.0)
    course = {
        "drift": np.linspace(0, 1, N_HITS),
        "two states": np.arange(N_HITS) % 2.0,
        "softening": (forces - FORCES[0]) / (FORCES[1] - FORCES[0]),
    }.get(kind, np.zeros(N_HITS))
    states = [_shifted(milling, 1 - shift * share) for share in course]
    if kind == "in some hits":
        silent = replace(milling, x=milling.x[1:], y=milling.y[1:])
        chosen = set(rng.choice(N_HITS, 3, replace=False).tolist())
        states = [milling if k in chosen else silent for k in range(N_HITS)]
    return Disturbed(tuple(states), tuple(forces.tolist()))


def _shifted(milling: RandomMilling, factor: float) -> RandomMilling:
    x, y = (tuple((f * factor, zeta, k) for f, zeta, k in modes) for modes in (milling.x, milling.y))
    return replace(milling, x=x, y=y)


def receptance(frequency: Floats, modes: Modes) -> np.ndarray:
    """Sum of real modes (m/N)."""
    parts = (1 / k / (1 - (frequency / f) ** 2 + 2j * zeta * frequency / f) for f, zeta, k in modes)
    return sum(parts, np.zeros(frequency.size, complex))


def make_hit(modes: Modes, peak: float, rng: np.random.Generator) -> Hit:
    """One hit: force (N) and acceleration (m/s^2) with the noise of sensors."""
    rate, n = RATE * OVERSAMPLING, int(2 * SECONDS * RATE * OVERSAMPLING)
    u = (np.arange(n) / rate - 0.01) / rng.uniform(1.6e-4, 2.2e-4)
    spectrum = np.fft.rfft(np.where((u > 0) & (u < 1), peak * np.sin(np.pi * u) ** 2, 0.0))
    f, keep = np.asarray(np.fft.rfftfreq(n, 1 / rate), dtype=np.float64), int(SECONDS * RATE)
    spectrum /= np.sqrt(1 + (f / (0.45 * RATE)) ** 16)
    force = np.fft.irfft(spectrum, n)[::OVERSAMPLING][:keep]
    moved = np.fft.irfft(-((2 * np.pi * f) ** 2) * receptance(f, modes) * spectrum, n)[::OVERSAMPLING][:keep]
    return Hit(force + 0.05 * rng.normal(size=keep), moved + rng.normal(size=keep), RATE)


def tap(disturbed: Disturbed, direction: TapDirection, rng: np.random.Generator) -> TapTest:
    """Tap test of one direction."""
    sides = (state.x if direction == "x" else state.y for state in disturbed.states)
    hits = tuple(make_hit(modes, peak, rng) for modes, peak in zip(sides, disturbed.forces, strict=True))
    flags = tuple(check_hit(hit) for hit in hits)
    good = [hit for hit, fault in zip(hits, flags, strict=True) if not fault]
    return TapTest(direction, Circumstances("drawn", TIME, "reference", direction), estimate_frf(good), hits, flags)


def measured(disturbed: Disturbed, rng: np.random.Generator) -> Assembly:
    """Return the tool as its tap tests in x and y show it."""
    x, y = (measure(tap(disturbed, direction, rng), MACHINE) for direction in ("x", "y"))
    return assemble(y, x, {})


def drawn_machines(count: int, seed: int, most_modes: int = 6) -> Iterator[tuple[RandomMilling, np.random.Generator]]:
    """Yield machines with a limit and with two modes at least in each direction."""
    made = 0
    for rng in np.random.default_rng(seed).spawn(20 * count):
        milling = random_case(rng)
        sides = len(milling.x), len(milling.y)
        if made < count and min(sides) >= 2 and sum(sides) <= most_modes and math.isfinite(limit_mm(milling)):
            made += 1
            yield milling, rng


def chatters_in_any_state(disturbed: Disturbed, table: ProgramTable, rng: np.random.Generator) -> bool:
    """Return whether a program chatters in any state that was met, or may do so."""
    cases = [
        state.case(table.depth_mm / 1e3, angle)
        for state in dict.fromkeys(disturbed.states)
        for angle in _feeds(state, rng)
    ]
    result = milling_simulation.judge(cases)
    return bool(np.any(result.growth > result.doubt))


def _feeds(milling: RandomMilling, rng: np.random.Generator) -> Sequence[float]:
    oblique = rng.uniform(0, math.pi, N_OBLIQUE if milling.feed == "both" else 0)
    return (*milling.feed_angles, *oblique.tolist())


def judge_disturbed(kind: str, count: int, seed: int) -> Counts:
    """Judge a program of 105 to 300 % of the least limit on each of some machines disturbed in one way."""
    counts = Counts()
    for milling, rng in drawn_machines(count, seed):
        disturbed = disturb(milling, kind, rng)
        tool, table = measured(disturbed, rng), program(milling, disturbed.limit_mm * rng.uniform(1.05, 3))
        word = evaluate_program(table, tool, MACHINE).stability
        counts.words[word] += 1
        counts.uncovered += bool(tool.uncovered)
        counts.wrong += word is Stability.STABLE and chatters_in_any_state(disturbed, table, rng)
    return counts


def judge_undisturbed(part: float, count: int, seed: int) -> Counts:
    """Judge a program of a part of the limit on each of some machines that stay as they are."""
    counts = Counts()
    for milling, rng in drawn_machines(count, seed):
        disturbed = disturb(milling, "", rng)
        tool = measured(disturbed, rng)
        counts.words[evaluate_program(program(milling, part * disturbed.limit_mm), tool, MACHINE).stability] += 1
        counts.uncovered += bool(tool.uncovered)
    return counts
