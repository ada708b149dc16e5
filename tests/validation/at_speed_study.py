"""Outcome of programs called stable and of recommended settings, once all natural frequencies have dropped at speed.

Truths and cuts are drawn here, taps have noise, and the simulation in the time domain is the judge: neither shares
code with what made verdicts and settings.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime

import milling_simulation
import msgspec
import numpy as np
from milling_simulation import Case, Modes
from random_milling import RandomMilling
from verdict_study import MACHINE, limit_mm, program

from lobewatch.machine import ProgramTable
from lobewatch.tool.assembly import Assembly
from lobewatch.verdicts.program_case import NO_TEST_CUTS
from lobewatch.verdicts.recommendation import recommend
from lobewatch.verdicts.verdict import Stability, evaluate_program
from modal import Mode

DROPS = (0.0, 0.02, 0.05, 0.07)
"""Relative drops of all natural frequencies of the truth; K drops with their square, the modal mass stays."""
TAP_ERRORS = (0.001, 0.04, 0.015)
"""Standard deviation of frequency, damping ratio and stiffness of a tap test (relative)."""
IMMERSIONS = (0.05, 0.1, 0.25, 0.5, 0.75, 1.0)
SHARES_OF_LIMIT = (0.3, 0.9)
"""Depth of a program over its limit, at least and at most."""


@dataclass(frozen=True)
class Outcome:
    """A cut that was called stable, and whether its truth chatters at each of `DROPS`."""

    number: int
    table: ProgramTable
    risk: float
    """Chance of chatter at speed as stated."""
    chatters: tuple[bool, ...] = ()

    @property
    def removal_rate(self) -> float:
        """Speed times depth (rpm mm), which is the removal rate of a cut at the same feed per tooth."""
        return self.table.speed_rpm * self.table.depth_mm


@dataclass
class Study:
    """Outcomes of a study: programs called stable, and settings recommended."""

    programs: list[Outcome] = field(default_factory=list)
    settings: list[Outcome] = field(default_factory=list)
    n_programs: int = 0
    n_machines: int = 0
    seconds: list[float] = field(default_factory=list)
    """CPU time of each recommendation (s)."""

    def count(self, outcomes: Sequence[Outcome]) -> list[int]:
        """Count the outcomes that chatter at each of `DROPS`."""
        return [sum(outcome.chatters[place] for outcome in outcomes) for place in range(len(DROPS))]


def draw_machine(rng: np.random.Generator, most_modes: int = 3) -> RandomMilling:
    """Draw a spindle with one to three modes in each direction, and all of a cut but its depth."""
    count, stiffness = int(rng.integers(1, most_modes + 1)), rng.uniform(8e6, 6e7)
    first = rng.uniform(400, 2500), rng.uniform(0.012, 0.05), stiffness
    others = ((rng.uniform(300, 4000), rng.uniform(0.012, 0.05), stiffness * rng.uniform(1, 8)) for _ in range(count))
    x = (first, *others)[:count]
    y = tuple((f * rng.uniform(0.9, 1.1), z * rng.uniform(0.8, 1.25), k * rng.uniform(0.7, 1.4)) for f, z, k in x)
    tangential = rng.uniform(600e6, 2500e6)
    return RandomMilling(
        x,
        y,
        rng.choice(["x", "y", "both"]).item(),
        int(rng.integers(2, 6)),
        rng.uniform(8e-3, 32e-3),
        float(rng.choice(IMMERSIONS)),
        rng.choice(["up", "down"]).item(),
        tangential,
        tangential * rng.uniform(0.15, 0.45),
        math.radians(rng.uniform(0, 40)) if rng.random() < 0.5 else 0.0,
        rng.uniform(5000, 24000),
    )


def tap(milling: RandomMilling, rng: np.random.Generator) -> Assembly:
    """Return the tool as tap tests with errors show it."""

    def measured(modes: Modes) -> list[Mode]:
        return [
            Mode(*(np.array(mode) * (1 + np.array(TAP_ERRORS) * rng.standard_normal(3))).tolist()) for mode in modes
        ]

    x, y = measured(milling.x), measured(milling.y)
    return Assembly("reference", datetime(2026, 1, 1, tzinfo=UTC), "drawn", x, y, ("x", "y"), None, {}, False, ())


def drop_modes(modes: Modes, drop: float) -> Modes:
    """Return modes with lower frequencies and the same modal masses and damping ratios."""
    return tuple((f * (1 - drop), zeta, k * (1 - drop) ** 2) for f, zeta, k in modes)


def true_cases(milling: RandomMilling, table: ProgramTable) -> list[Case]:
    """Return the truth of a cut at each of `DROPS`, fed along its axes and, if both are, between them."""
    angles = (*milling.feed_angles, *((math.pi / 4, 3 * math.pi / 4) if milling.feed == "both" else ()))
    return [
        replace(milling, x=drop_modes(milling.x, drop), y=drop_modes(milling.y, drop), speed_rpm=table.speed_rpm).case(
            table.depth_mm / 1e3, angle
        )
        for drop in DROPS
        for angle in angles
    ]


def judge(milling: RandomMilling, outcome: Outcome) -> Outcome:
    """Return the outcome with the verdict of the simulation; what is open counts as chatter."""
    found = milling_simulation.judge(true_cases(milling, outcome.table))
    unstable = found.chatters | (found.doubt >= np.abs(found.growth))
    return replace(outcome, chatters=tuple(np.any(unstable.reshape(len(DROPS), -1), axis=1).tolist()))


def study(numbers: Sequence[int], seed: int, most_modes: int = 3, n_programs: int = 2) -> Study:
    """Judge programs called stable and recommended settings of some machines."""
    counts = Study()
    for number in numbers:
        rng = np.random.default_rng((seed, number))
        milling = draw_machine(rng, most_modes)
        limit = limit_mm(milling)
        if not math.isfinite(limit):
            continue
        tool = tap(milling, rng)
        counts.n_machines += 1
        for _ in range(n_programs):
            table = program(milling, limit * rng.uniform(*SHARES_OF_LIMIT))
            counts.n_programs += 1
            verdict = evaluate_program(table, tool, MACHINE)
            if verdict.stability is Stability.STABLE:
                counts.programs.append(judge(milling, Outcome(number, table, verdict.chatter_risk)))
        start = time.process_time()
        setting = recommend(program(milling, 1.0), tool, MACHINE, NO_TEST_CUTS).setting
        counts.seconds.append(time.process_time() - start)
        if setting is not None:
            place = {"speed_rpm": setting.speed_rpm, "depth_mm": setting.depth_mm}
            table = msgspec.structs.replace(program(milling, 1.0), **place)
            counts.settings.append(judge(milling, Outcome(number, table, setting.chatter_risk)))
    return counts


def chance_truths(milling: RandomMilling, outcome: Outcome, count: int, rng: np.random.Generator) -> list[Case]:
    """Return truths as the stated chance assumes them: drop 0 to 5 %, zeta, K, Kt and speed, in one feed direction."""
    made = []
    for _ in range(count):
        drop, (damping, stiffness, force) = rng.uniform(0, 0.05), rng.standard_normal(3) * (0.25, 0.10, 0.30)
        damped, stiff, push = (max(1 + part, 0.1) for part in (damping, stiffness, force))
        x, y = (
            tuple((f, 1.1 * damped * zeta, stiff * k) for f, zeta, k in drop_modes(modes, drop))
            for modes in (milling.x, milling.y)
        )
        push *= rng.uniform(0.8, 1.2)
        true = replace(
            milling,
            x=x,
            y=y,
            tangential=push * milling.tangential,
            radial=push * rng.uniform(0.8, 1.2) * milling.radial,
            speed_rpm=outcome.table.speed_rpm * rng.uniform(0.99, 1.01),
        )
        made.append(true.case(outcome.table.depth_mm / 1e3, float(rng.choice(milling.feed_angles))))
    return made
