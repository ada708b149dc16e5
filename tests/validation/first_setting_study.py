"""First recommendation for a listed material on hidden spindles, before any cut, by time-domain simulation.

Truths are drawn here: Kt and Kr/Kt evenly over the published range, each apart, and one frequency drop of all modes.
The optimum is the textbook form of the lobes of a slot, and the simulation in the time domain judges each setting.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

import milling_simulation
import numpy as np
from learning_study import TEETH, Modes, slot_limits
from milling_simulation import Case
from numpy.typing import NDArray
from speed_grid import list_speeds

from lobes.materials import fold_material_name, materials_by_name
from lobewatch.machine import Machine, ProgramTable
from lobewatch.machine.settings.drive_power import CutRange
from lobewatch.machine.settings.machine_file import parse_machine_file
from lobewatch.tool.assembly import Assembly
from lobewatch.verdicts.program_case import NO_TEST_CUTS
from lobewatch.verdicts.recommendation import recommend
from lobewatch.verdicts.verdict import Stability, evaluate_program
from modal import Mode

LOW, HIGH = 600.0, 20000.0
"""Spindle speeds (rpm)."""
FILE = f'[machine]\nname = "drawn"\n[speed]\nlow_rpm = {LOW}\nhigh_rpm = {HIGH}\n'
FAST_FILE = f'{FILE}[[tool]]\nname = "reference"\ncutting_speed_m_min = [20, 800]\n'
CATALOGUE, FAST = parse_machine_file(FILE), parse_machine_file(FAST_FILE)
"""Machines with the cutting speeds of the table, and with a tool that allows any speed of the spindle."""
MATERIALS = (
    "C45",
    "42CrMo4",
    "16MnCr5",
    "X5CrNi18-10",
    "EN-GJL-250",
    "EN-GJS-600-3",
    "EN AW-6082",
    "EN AW-7075",
    "TiAl6V4",
    "Inconel 718",
)
DIAMETER = 12.0
"""Tool diameter (mm); the cut is a slot."""
TAP_ERRORS = (0.001, 0.03, 0.01)
"""Standard deviation of frequency, damping ratio and stiffness of a tap test (relative)."""
MOST_DROP = 0.05
"""Largest drop of all frequencies at speed; modal masses stay."""
FEED_ANGLES = (0.0, math.pi / 4, math.pi / 2, 3 * math.pi / 4)


@dataclass(frozen=True)
class Outcome:
    """Setting of one material on one spindle, recommended or called stable, and its truth."""

    material: str
    share: float = 0.0
    """Removal rate over the true optimum; 0 without a setting."""
    risk: float = math.nan
    """Chance of chatter as stated; NaN without a setting."""
    cases: tuple[Case, ...] = ()
    """Truth of the setting in each feed direction; none without a setting."""


class Spindle:
    """A spindle as tapped and as it is at speed, with the true Kt and Kr of a listed material."""

    def __init__(self, number: int, machine: Machine, seed: int) -> None:
        self.draw = draw = np.random.default_rng((seed, number))
        self.material, self.machine = MATERIALS[number % len(MATERIALS)], machine
        x = _draw_modes(draw)
        y = tuple(
            (f * draw.uniform(0.9, 1.1), z * draw.uniform(0.8, 1.25), k * draw.uniform(0.7, 1.4)) for f, z, k in x
        )
        listed = materials_by_name()[fold_material_name(self.material)]
        assert listed.tangential_range is not None
        assert listed.ratio_range is not None
        self.tangential = draw.uniform(*listed.tangential_range)
        self.radial = self.tangential * draw.uniform(*listed.ratio_range)
        drop = draw.uniform(0, MOST_DROP)
        sides, time = (_tap(x, draw), _tap(y, draw)), datetime(2026, 1, 1, tzinfo=UTC)
        self.tool = Assembly("reference", time, "drawn", *sides, ("x", "y"), None, {}, False, ())
        self.x, self.y = _drop(x, drop), _drop(y, drop)

    def program(self, speed_rpm: float, depth_mm: float) -> ProgramTable:
        """Return a slot as written in machine.toml."""
        return ProgramTable(
            name="drawn",
            teeth=TEETH,
            radial_depth_mm=DIAMETER,
            tool_diameter_mm=DIAMETER,
            direction="down",
            material=self.material,
            speed_rpm=speed_rpm,
            depth_mm=depth_mm,
            feed="both",
        )

    def outcome(self, speed_rpm: float, depth_mm: float, risk: float) -> Outcome:
        """Return a setting with its truth."""
        reach = CutRange.of(self.machine, self.program(speed_rpm, depth_mm))
        speeds = list_speeds(reach.low_rpm, reach.high_rpm)
        best = float(np.max(speeds * slot_limits(self.x, self.y, self.tangential, self.radial, speeds)))
        forces = self.tangential, self.radial
        cases = tuple(
            Case(self.x, self.y, angle, TEETH, 1.0, "down", *forces, 0.0, speed_rpm, depth_mm / 1e3)
            for angle in FEED_ANGLES
        )
        return Outcome(self.material, speed_rpm * depth_mm / 1e3 / best, risk, cases)


def recommend_first(number: int, machine: Machine, seed: int = 41) -> Outcome:
    """Draw a spindle and a material, and recommend."""
    spindle = Spindle(number, machine, seed)
    setting = recommend(spindle.program(HIGH, 1.0), spindle.tool, machine, NO_TEST_CUTS).setting
    if setting is None:
        return Outcome(spindle.material)
    return spindle.outcome(setting.speed_rpm, setting.depth_mm, setting.chatter_risk)


def check_program(number: int, machine: Machine, seed: int = 43) -> Outcome:
    """Draw a spindle, a material, a speed and a depth near the border of `stable`, and check."""
    spindle = Spindle(number, machine, seed)
    reach = CutRange.of(machine, spindle.program(HIGH, 1.0))
    speed = spindle.draw.uniform(reach.low_rpm, reach.high_rpm)
    limit = min(1e3 * evaluate_program(spindle.program(speed, 1.0), spindle.tool, machine).limit_low, DIAMETER)
    program = spindle.program(speed, limit * spindle.draw.uniform(0.6, 1.0))
    verdict = evaluate_program(program, spindle.tool, machine)
    if verdict.stability is not Stability.STABLE:
        return Outcome(spindle.material)
    return spindle.outcome(speed, program.depth_mm, verdict.chatter_risk)


def chattering(outcomes: Sequence[Outcome]) -> NDArray[np.bool_]:
    """Return which outcomes with a setting chatter in any feed direction; what has not converged counts."""
    judged = milling_simulation.judge([case for outcome in outcomes for case in outcome.cases])
    is_bad = judged.chatters | (judged.doubt >= np.abs(judged.growth))
    return np.asarray(np.any(is_bad.reshape(-1, len(FEED_ANGLES)), axis=1))


def _draw_modes(draw: np.random.Generator) -> Modes:
    """One or two modes, the second faster and stiffer."""
    f, zeta, k = draw.uniform(600, 2200), draw.uniform(0.012, 0.045), draw.uniform(8e6, 4e7)
    return ((f, zeta, k), (f * draw.uniform(1.35, 2.2), zeta, k * draw.uniform(1.5, 8)))[: int(draw.integers(1, 3))]


def _tap(modes: Modes, draw: np.random.Generator) -> list[Mode]:
    return [Mode(*(np.array(mode) * (1 + np.array(TAP_ERRORS) * draw.standard_normal(3))).tolist()) for mode in modes]


def _drop(modes: Modes, drop: float) -> Modes:
    return tuple((f * (1 - drop), zeta, k * (1 - drop) ** 2) for f, zeta, k in modes)
