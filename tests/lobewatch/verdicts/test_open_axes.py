"""Verdicts on programs whose tool has unknown principal directions."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest

from lobes import program_limit, project_modes
from lobewatch.machine import Machine, ProgramTable
from lobewatch.machine.settings.machine_file import parse_machine_file
from lobewatch.tool.assembly import Assembly
from lobewatch.verdicts import Stability
from lobewatch.verdicts.monte_carlo import find_sample_limits
from lobewatch.verdicts.program_case import ProgramCase
from lobewatch.verdicts.program_samples import ProgramSamples, build_median_row, draw_samples, find_worst_limit
from lobewatch.verdicts.verdict import Verdict, evaluate_program
from modal import Mode

MACHINE: Machine = parse_machine_file('[machine]\nname = "m"\n[speed]\nlow_rpm = 3000\nhigh_rpm = 20000\n')


def tool(angle_deg: float = 35.0) -> Assembly:
    """Return a tool with two close perpendicular modes, tapped in x and y."""
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    x, y, _ = project_modes([Mode(1500.0, 0.03, 20e6), Mode(1575.0, 0.028, 22e6)], np.array([[c, s], [-s, c]]))
    return Assembly("T", datetime(2026, 1, 1, tzinfo=UTC), "tap", x, y, ("x", "y"), None, {}, False, ())


def program(depth_mm: float, speed_rpm: float = 7000.0) -> ProgramTable:
    return ProgramTable(
        name="finish",
        tool="T",
        teeth=4,
        radial_depth_mm=8.0,
        tool_diameter_mm=16.0,
        direction="down",
        tangential_n_per_mm2=800.0,
        radial_n_per_mm2=240.0,
        helix_deg=0.0,
        speed_rpm=speed_rpm,
        depth_mm=depth_mm,
        feed="x",
    )


def limits_mm(speed_rpm: float = 7000.0) -> list[float]:
    """Limit in each of the possible principal directions, without anything of the verdict."""
    case = ProgramCase(program(1.0, speed_rpm), tool(), MACHINE)
    axes, (x, y) = case.spindle.principal_directions, (case.spindle.x, case.spindle.y)
    return [1e3 * program_limit(case.program, x, y, case.cuts, each).limit for each in axes.possible_vectors]


def verdict(depth_mm: float) -> Verdict:
    return evaluate_program(program(depth_mm), tool(), MACHINE)


def test_a_program_that_chatters_in_some_directions_only_is_doubtful_by_cross() -> None:
    low, *_, high = sorted(limits_mm())
    assert high > 1.2 * low
    between = verdict((low + high) / 2)
    assert (between.stability, between.decisive_cause) == (Stability.DOUBTFUL, "cross")
    assert between.is_stable
    assert 1e3 * between.limit_low <= low * (1 + 1e-6)
    assert any(1e3 * between.limit == pytest.approx(limit) for limit in limits_mm())
    assert between.depth_margin > 0


def test_a_program_that_chatters_in_all_directions_is_not_stable() -> None:
    beyond = verdict(1.1 * max(limits_mm()))
    assert (beyond.stability, beyond.decisive_cause) == (Stability.NOT_STABLE, "")


def test_below_the_worst_direction_its_limit_is_shown() -> None:
    below = verdict(0.4 * min(limits_mm()))
    assert below.stability is Stability.STABLE
    assert 1e3 * below.limit == pytest.approx(min(limits_mm()))


@pytest.mark.parametrize("speed_rpm", [4100.0, 9300.0, 16000.0])
def test_the_worst_of_all_directions_is_found(speed_rpm: float) -> None:
    worst = find_worst_limit(ProgramCase(program(1.0, speed_rpm), tool(), MACHINE))
    every = limits_mm(speed_rpm)
    assert 1e3 * worst.limit.limit == pytest.approx(min(every), rel=2e-3)
    assert worst.axes_ratio == pytest.approx(max(every) / min(every), rel=5e-3)


def test_samples_far_below_the_median_have_their_own_limits() -> None:
    """Forty samples of a third of the stiffness and less: more than are refined one by one."""
    stiff = replace(tool(), cross=[])
    case = ProgramCase(program(1.0), stiff, MACHINE)
    softer = np.append(1.0, np.linspace(0.15, 0.35, 40))
    median = build_median_row(case.program, stiff)
    rows = replace(median[np.zeros(41, dtype=np.intp)], stiffness=median.stiffness * softer[:, np.newaxis])
    drawn = draw_samples(case, find_worst_limit(case))
    samples = ProgramSamples(rows, drawn.cuts, drawn.limits, drawn.piece_factor, drawn.uncertainty)
    found = find_sample_limits(samples, case.depth)
    assert found == pytest.approx(softer * drawn.limits[0], rel=0.05)
