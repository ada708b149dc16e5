"""Setting search: shortcuts do not change results, and neighbors of likely settings are searched."""

from __future__ import annotations

from datetime import UTC, datetime

import numpy as np
import pytest

from lobewatch.machine import Machine, ProgramTable
from lobewatch.machine.settings.machine_file import parse_machine_file
from lobewatch.tool.assembly import Assembly
from lobewatch.verdicts.monte_carlo import run_monte_carlo
from lobewatch.verdicts.program_case import ProgramCase, build_program
from lobewatch.verdicts.safe_depth_estimates import select_critical_samples
from lobewatch.verdicts.setting_robustness import MIN_DEPTH_MARGIN, Setting, sweep_neighborhood
from lobewatch.verdicts.setting_search import SettingSearch
from modal import Mode

MACHINE: Machine = parse_machine_file('[machine]\nname = "m"\n[speed]\nlow_rpm = 5000\nhigh_rpm = 15000\n')
AT_REST: Machine = parse_machine_file(
    '[machine]\nname = "m"\n[speed]\nlow_rpm = 5000\nhigh_rpm = 15000\ndrop_percent = [0, 0]\n'
)
"""Machine whose frequencies do not drop at speed: its likely depth is farther from the deepest setting."""


def tool(apart: float = 1.06) -> Assembly:
    """One mode in x, and one in y whose frequency is so many times as high."""
    x, y = ([Mode(700.0 * share, 0.03, 4e7)] for share in (1.0, apart))
    return Assembly("reference", datetime(2026, 1, 1, tzinfo=UTC), "t", x, y, ("x", "y"), None, {}, False, ())


def cut(immersion: float = 1.0, depth: float = 1.0, speed: float = 9000.0) -> ProgramTable:
    return ProgramTable(
        name="a",
        teeth=4,
        radial_depth_mm=20 * immersion,
        tool_diameter_mm=20,
        direction="down",
        tangential_n_per_mm2=1600,
        radial_n_per_mm2=600,
        helix_deg=30,
        speed_rpm=speed,
        depth_mm=depth,
    )


@pytest.mark.parametrize(("immersion", "depth"), [(1.0, 0.9), (0.2, 4.5)])
def test_samples_that_are_skipped_in_other_cuts_are_stable_there(immersion: float, depth: float) -> None:
    judgement = run_monte_carlo(ProgramCase(cut(immersion, depth), tool(1.3), MACHINE))
    draws = sweep_neighborhood(judgement.samples, 0.02, lambda fall: 1 - fall)
    every, counted = draws.growth(depth / 1e3)[:, 0], draws.critical_growth(depth / 1e3)
    assert np.array_equal(counted >= 0, every >= 0)
    assert np.all(counted <= every + 1e-6)
    assert counted[np.argmax(every)] == pytest.approx(np.max(every), abs=1e-4)


def test_a_narrow_pocket_is_climbed_from_where_it_is_likely() -> None:
    search = SettingSearch(ProgramCase(cut(), tool(), AT_REST))
    best = search.best
    assert best is not None
    top, likely = search.likely_depths.removal_peaks(1)[0]
    beside = search.verify(round(top, -1), round(0.97 * likely * 20) / 20)
    chips = beside.speed_rpm * beside.depth_mm if isinstance(beside, Setting) else 0.0
    assert best.speed_rpm > 1.005 * top
    assert best.speed_rpm * best.depth_mm > 1.05 * chips > 0
    again = SettingSearch(ProgramCase(cut(), tool(), AT_REST)).verify(best.speed_rpm, best.depth_mm)
    assert again == best


@pytest.mark.quick
def test_few_samples_let_no_deeper_pass_than_the_middle_has_to_spare() -> None:
    search = SettingSearch(ProgramCase(cut(), tool(), MACHINE))
    judgement = run_monte_carlo(ProgramCase(cut(depth=0.5), tool(), MACHINE))
    program = build_program(cut(depth=0.5), MACHINE)
    few = select_critical_samples(search.case, program, 0.02, search.stiffness_at)
    assert 0 < few.deepest_stable(20e-3) <= 1.01 * judgement.median.limit / (1 + MIN_DEPTH_MARGIN)
    assert few.deepest_stable(1e-4) == pytest.approx(1e-4)
