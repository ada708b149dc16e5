"""Monte Carlo basis of verdicts: a stable median with much margin may still chatter in a sample."""

from __future__ import annotations

from datetime import UTC, datetime

import numpy as np

from lobewatch.machine import ProgramTable
from lobewatch.machine.settings.machine_file import parse_machine_file
from lobewatch.tool.assembly import Assembly
from lobewatch.verdicts.monte_carlo import run_monte_carlo
from lobewatch.verdicts.program_case import ProgramCase
from modal import Mode

DEPTH = 3.6
"""Depth (mm), of which the limit is 1.5 times, 1.8 times or more where y gives way most."""


def mode(frequency: float, stiffness: float, error: float) -> Mode:
    """Build a mode with a relative standard error of its stiffness."""
    errors = np.array([1e-4 * frequency, 3e-5, error * stiffness])
    return Mode(frequency, 0.03, stiffness, covariance=np.diag(errors**2))


def test_samples_that_chatter_in_a_direction_of_much_to_spare_alone_are_seen() -> None:
    machine, tapped = parse_machine_file('[machine]\nname = "m"\n'), datetime(2026, 1, 1, tzinfo=UTC)
    x, y = [mode(800, 3e7, 0.001)], [mode(990, 5e7, 0.3)]
    tool = Assembly("reference", tapped, "t", x, y, ("x", "y"), None, {}, False, ())
    program = ProgramTable(
        name="a",
        teeth=3,
        radial_depth_mm=4,
        tool_diameter_mm=20,
        direction="down",
        tangential_n_per_mm2=1400,
        radial_n_per_mm2=500,
        helix_deg=30,
        speed_rpm=5720,
        depth_mm=DEPTH,
    )
    judgement = run_monte_carlo(ProgramCase(program, tool, machine))
    draws, depth = judgement.samples, DEPTH / 1e3
    assert judgement.median.stable
    assert judgement.low > 1.05 * depth
    assert not np.any(draws.with_lowest_cuts(0.0).growth(depth) >= 0)
    expected = draws.growth(depth)[1:, 0] >= 0
    assert 3 <= np.sum(expected) <= 30
    assert judgement.chatters.tolist() == expected.tolist()
    assert not judgement.is_stable_throughout
