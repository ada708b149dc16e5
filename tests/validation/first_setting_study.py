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
from modal import Mode

LOW, HIGH = 600.0, 20000.0
"""Spindle speeds (rpm)."""
FILE = f'[machine]\nname = "drawn"\n[speed]\nlow_rpm = {LOW}\nhigh_rpm = {HIGH}\n'
FAST_FILE = f'{FILE}[[tool]]\nname = "reference"\ncutting_speed_m_min = [20, 800]\n'
CATALOGUE, FAST = parse_machine_file(FILE), parse_machine_file(FAST_FILE)
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
class FirstSetting:
    """First recommendation for one material on one spindle."""

    material: str
    share: float
    """Removal rate over the true optimum; 0 without a setting."""
    chance: float
    """Chance of chatter as stated; NaN without a setting."""
    cases: tuple[Case, ...] = ()
    """Truth of the setting in each feed direction; none without a setting."""


def first_setting(number: int, machine: Machine, seed: int = 41) -> FirstSetting:
    """Draw a spindle and a material, and recommend."""
    material = MATERIALS[number % len(MATERIALS)]
    draw = np.random.default_rng((seed, number))
    x = _draw_modes(draw)
    y = tuple((f * draw.uniform(0.9, 1.1), z * draw.uniform(0.8, 1.25), k * draw.uniform(0.7, 1.4)) for f, z, k in x)
    listed = materials_by_name()[fold_material_name(material)]
    assert listed.tangential_range is not None
    assert listed.ratio_range is not None
    tangential = draw.uniform(*listed.tangential_range)
    radial = tangential * draw.uniform(*listed.ratio_range)
    drop = draw.uniform(0, MOST_DROP)
    table = ProgramTable(
        name="drawn",
        teeth=TEETH,
        radial_depth_mm=DIAMETER,
        tool_diameter_mm=DIAMETER,
        direction="down",
        material=material,
        speed_rpm=HIGH,
        depth_mm=1.0,
        feed="both",
    )
    tapped = (_tap(x, draw), _tap(y, draw))
    tool = Assembly("reference", datetime(2026, 1, 1, tzinfo=UTC), "drawn", *tapped, ("x", "y"), None, {}, False, ())
    setting = recommend(table, tool, machine, NO_TEST_CUTS).setting
    if setting is None:
        return FirstSetting(material, 0.0, math.nan)
    true_x, true_y = _drop(x, drop), _drop(y, drop)
    reach = CutRange.of(machine, table)
    speeds = list_speeds(reach.low_rpm, reach.high_rpm)
    best = float(np.max(speeds * slot_limits(true_x, true_y, tangential, radial, speeds)))
    depth = setting.depth_mm / 1e3
    cases = tuple(
        Case(true_x, true_y, angle, TEETH, 1.0, "down", tangential, radial, 0.0, setting.speed_rpm, depth)
        for angle in FEED_ANGLES
    )
    return FirstSetting(material, setting.speed_rpm * depth / best, setting.chatter_risk, cases)


def chattering(settings: Sequence[FirstSetting]) -> NDArray[np.bool_]:
    """Return which settings chatter in any feed direction; what has not converged counts."""
    judged = milling_simulation.judge([case for setting in settings for case in setting.cases])
    is_bad = judged.chatters | (judged.doubt >= np.abs(judged.growth))
    return np.any(is_bad.reshape(-1, len(FEED_ANGLES)), axis=1)


def _draw_modes(draw: np.random.Generator) -> Modes:
    """One or two modes, the second faster and stiffer."""
    f, zeta, k = draw.uniform(600, 2200), draw.uniform(0.012, 0.045), draw.uniform(8e6, 4e7)
    return ((f, zeta, k), (f * draw.uniform(1.35, 2.2), zeta, k * draw.uniform(1.5, 8)))[: int(draw.integers(1, 3))]


def _tap(modes: Modes, draw: np.random.Generator) -> list[Mode]:
    return [Mode(*(np.array(mode) * (1 + np.array(TAP_ERRORS) * draw.standard_normal(3))).tolist()) for mode in modes]


def _drop(modes: Modes, drop: float) -> Modes:
    return tuple((f * (1 - drop), zeta, k * (1 - drop) ** 2) for f, zeta, k in modes)
