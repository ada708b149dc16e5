"""Outcome of cuts that were called stable, on random machines with true systems within the uncertainty.

Truths are drawn here, by the table of docs/lobes.md, and judged by the simulation in the time domain: neither shares
code with what made the verdicts.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime

import milling_simulation
import numpy as np
from milling_simulation import Case, Modes
from random_milling import RandomMilling, random_case
from scipy.stats import beta

from lobes import program_limit
from lobewatch.machine import Machine, ProgramTable
from lobewatch.machine.settings.machine_file import parse_machine_file
from lobewatch.tool.assembly import Assembly
from lobewatch.verdicts.program_case import ProgramCase, build_program
from lobewatch.verdicts.recommendation import advise
from lobewatch.verdicts.verdict import Stability, evaluate_program
from modal import Mode

MACHINE: Machine = parse_machine_file('[machine]\nname = "random"\n[speed]\nlow_rpm = 1500\nhigh_rpm = 24000\n')


@dataclass
class Study:
    """Counts."""

    stable_programs: int = 0
    stable: list[Case] = field(default_factory=list)
    """Truths of programs called stable."""
    settings: int = 0
    recommended: list[Case] = field(default_factory=list)
    """Truths of settings recommended."""
    refused: int = 0
    """Recommended settings that are not called stable when entered."""


def study(count: int, seed: int, truths: int, most_modes: int = 12) -> Study:
    """`count` machines, each with a program of 30 to 80 % of its limit and one of 105 to 300 %.

    Machines of more modes than most_modes are passed over.
    """
    counts = Study()
    for rng in np.random.default_rng(seed).spawn(count):
        milling = random_case(rng)
        limit = limit_mm(milling) if len(milling.x + milling.y) <= most_modes else math.inf
        if not math.isfinite(limit):
            continue
        below, above = (program(milling, limit * rng.uniform(*share)) for share in ((0.3, 0.8), (1.05, 3.0)))
        if evaluate_program(below, assembly(milling), MACHINE).stability is Stability.STABLE:
            counts.stable_programs += 1
            counts.stable += drawn_truths(milling, below, truths, rng)
        for setting in settings(milling, above):
            counts.settings += 1
            counts.refused += evaluate_program(setting, assembly(milling), MACHINE).stability is not Stability.STABLE
            counts.recommended += drawn_truths(milling, setting, truths, rng)
    return counts


def settings(milling: RandomMilling, table: ProgramTable) -> Iterator[ProgramTable]:
    """Yield the programs recommended in place of one."""
    advice = advise(evaluate_program(table, assembly(milling), MACHINE), MACHINE)
    for setting in dict.fromkeys(filter(None, (advice.best, advice.deepest_here))):
        yield program(milling, setting.depth_mm, setting.speed_rpm)


def drawn_truths(milling: RandomMilling, table: ProgramTable, count: int, rng: np.random.Generator) -> list[Case]:
    """Systems within the uncertainty of a first tap test, fed in one of the directions of the program."""
    made = []
    for _ in range(count):
        push, share, speed = 1 + np.array([0.2, 0.2, 0.01]) * rng.uniform(-1, 1, 3)
        true = replace(
            milling,
            x=_moved(milling.x, rng),
            y=_moved(milling.y, rng),
            tangential=milling.tangential * push,
            radial=milling.radial * push * share,
            speed_rpm=table.speed_rpm * speed,
        )
        angle = rng.uniform(0, math.pi)
        feed = {"x": 0.0, "y": math.pi / 2}.get(milling.feed, float(angle))
        made.append(true.case(table.depth_mm / 1e3, feed))
    return made


def _moved(modes: Modes, rng: np.random.Generator) -> Modes:
    def moved(value: float, width: float) -> float:
        return value * (1 + width * rng.uniform(-1, 1))

    return tuple((moved(f, 0.003), moved(zeta, 0.1), moved(k, 0.03)) for f, zeta, k in modes)


def chattering(truths: list[Case]) -> int:
    """Return how many cases chatter; one that has not converged counts."""
    simulated = milling_simulation.judge(truths)
    return int(np.sum(simulated.chatters | (simulated.doubt >= np.abs(simulated.growth))))


def upper_limit(number: int, of: int) -> float:
    """Return the one-sided 95 % upper limit of a share. Source: Clopper & Pearson 1934."""
    return float(beta.ppf(0.95, number + 1, of - number)) if number < of else 1.0


def limit_mm(milling: RandomMilling) -> float:
    """Deepest stable depth (mm) without uncertainty."""
    table = program(milling, 2.0)
    cuts = ProgramCase(table, assembly(milling), MACHINE).cuts
    return 1e3 * program_limit(build_program(table, MACHINE), *_modes(milling), cuts).limit


def program(milling: RandomMilling, depth_mm: float, speed_rpm: float | None = None) -> ProgramTable:
    """Return the cut as written in machine.toml."""
    return ProgramTable(
        name="drawn",
        teeth=milling.teeth,
        radial_depth_mm=milling.immersion * milling.diameter * 1e3,
        tool_diameter_mm=milling.diameter * 1e3,
        direction=milling.direction,
        tangential_n_per_mm2=milling.tangential / 1e6,
        radial_n_per_mm2=milling.radial / 1e6,
        helix_deg=math.degrees(milling.helix),
        speed_rpm=milling.speed_rpm if speed_rpm is None else speed_rpm,
        depth_mm=depth_mm,
        feed=milling.feed,
    )


def assembly(milling: RandomMilling, directions: tuple[str, ...] = ("x", "y")) -> Assembly:
    """Return the machine as tap tests without errors would show it."""
    x, y = _modes(milling)
    if directions == ("x",):
        y = x
    return Assembly("reference", datetime(2026, 1, 1, tzinfo=UTC), "drawn", x, y, directions, None, {}, False, ())


def _modes(milling: RandomMilling) -> tuple[list[Mode], list[Mode]]:
    return [Mode(*mode) for mode in milling.x], [Mode(*mode) for mode in milling.y]
