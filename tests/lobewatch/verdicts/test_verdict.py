"""Verdict and its uncertainty: causes, remedies, predicted and tapped tools, frequency margin."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dsm import calibrate
from lobes import Program, program_limit
from lobewatch.verdicts import Stability
from lobewatch.verdicts.program_case import build_program
from lobewatch.verdicts.setting_robustness import find_tolerable_drop, model_softening

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""
TWIN = """
[[tool]]
name = "twin"
segments = [
    { length_mm = 26.5, outer_mm = 31.5 },
    { length_mm = 23.0, outer_mm = 33.0 },
    { length_mm = 19.5, outer_mm = 35.5 },
    { length_mm = 24.5, outer_mm = 36.0 },
]
"""
"""The first four segments of the example's spindle: the tool that is tapped."""


def tap_the_model(shop: Shop, *frequencies: float) -> None:
    """x, then y, as the model has it with its bearings softened until it has these frequencies."""
    for days, (frequency, direction) in enumerate(zip(frequencies, "xy", strict=False)):
        stiffness = calibrate(shop.folder.machine.model("reference"), frequency).modal_stiffness_after
        shop.tap(days / 10, frequency, direction, stiffness=stiffness)


@pytest.mark.parametrize("program", [(12900, 2.2), (8700, 0.9), (16000, 0.5)])
def test_a_twin_that_was_never_tapped_has_the_limit_of_the_tool_tapped(
    shop: Shop, program: tuple[float, float]
) -> None:
    shop.run(("tapped", *program))
    text = shop.path.joinpath("machine.toml").read_text("utf-8")
    slot = text[text.index("[[program]]") : text.index("# The spindle of the example")]
    shop.put(slot + slot.replace('"tapped"', '"untapped"').replace('"reference"', '"twin"'))
    shop.edit("# A tool that is not tapped", f"{TWIN}\n# A tool that is not tapped")
    tap_the_model(shop, 1713.0, 1650.0)
    tapped, twin = shop.logbook.verdicts()
    assert (tapped.is_measured, twin.is_measured) == (True, False)
    assert twin.limit == pytest.approx(tapped.limit, rel=0.01)
    assert twin.limit_low < tapped.limit_low < tapped.limit_high < twin.limit_high
    assert "prediction" in twin.samples.uncertainty.modes
    assert "predicted" in [remark.code for remark in twin.remarks]


def test_a_direction_that_was_not_tapped_is_like_the_other_one_and_widens_the_uncertainty(shop: Shop) -> None:
    tap_the_model(shop, 1713.0)
    alone = shop.logbook.verdicts()
    shop.tap(
        0.1, 1713.0, "y", stiffness=calibrate(shop.folder.machine.model("reference"), 1713.0).modal_stiffness_after
    )
    for single, double in zip(alone, shop.logbook.verdicts(), strict=True):
        assert single.limit == pytest.approx(double.limit, rel=1e-4)
        assert (single.stability, double.stability) == (Stability.DOUBTFUL, Stability.STABLE)
        assert single.limit_low < 0.9 * double.limit_low
        assert [remark.code for remark in single.remarks] == ["one-direction", "doubt-decides"]


def test_a_program_runs_along_one_axis_or_both(shop: Shop) -> None:
    shop.tap(0, 1713.0, stiffness=3e7)
    shop.tap(0.1, 1300.0, "y", stiffness=9e7)
    assembly = shop.logbook.assembly()
    shop.run(("both", 12900, 1))
    shop.edit("radial_depth_mm = 20\n", "radial_depth_mm = 5\n")
    (verdict,) = shop.logbook.verdicts()
    program = build_program(verdict.program, shop.folder.machine)
    limits = [
        program_limit(program, assembly.x, assembly.y, [replace(program.cut, feed_angle=np.radians(15.0 * i))]).limit
        for i in range(12)
    ]
    assert verdict.limit == pytest.approx(min(limits))
    assert verdict.feed_angle == pytest.approx(np.radians(15.0 * np.argmin(limits)))


def test_decay_left_ends_where_the_limit_crosses_the_depth(shop: Shop) -> None:
    shop.tap_both()
    for verdict in shop.logbook.verdicts():
        stiffness_at, remark = model_softening(verdict.assembly)
        assert remark.code == "decay-assumption"
        fall = find_tolerable_drop(verdict.samples, verdict.program.depth_mm / 1e3, stiffness_at)
        program = build_program(verdict.program, shop.folder.machine)
        if np.isinf(fall):
            assert limit_after(verdict, program, 0.2, stiffness_at(0.2)) > program.depth
            continue
        assert 0.005 < fall < 0.2
        for side, stable in ((-0.004, True), (0.004, False)):
            limit = limit_after(verdict, program, fall + side, stiffness_at(fall + side))
            assert (limit > program.depth) == stable


def limit_after(verdict: Any, program: Program, fall: float, stiffness: float) -> float:
    """Limit in the middle with all frequencies fallen."""
    tool = verdict.assembly
    x, y = ([mode.scaled(1 - fall, stiffness, "aged") for mode in modes] for modes in (tool.x, tool.y))
    return program_limit(program, x, y, verdict.samples.cuts).limit


def test_k_follows_the_model_as_the_frequency_falls_and_stays_without_one(shop: Shop) -> None:
    shop.tap_both()
    stiffness_at, remark = model_softening(shop.logbook.assembly())
    model = shop.folder.machine.model("reference")
    ratios = [calibrate(model, 1690.0 * share).modal_stiffness_after for share in (1.0, 0.9)]
    assert stiffness_at(0.1) == pytest.approx(ratios[1] / ratios[0], abs=1e-3)
    assert stiffness_at(0.1) == pytest.approx(0.986, abs=0.002)
    assert "20 %" in remark.text
    toml = shop.path / "machine.toml"
    toml.write_text(toml.read_text("utf-8").partition("# The spindle of the example")[0], "utf-8")
    stiffness_at, remark = model_softening(shop.logbook.assembly())
    assert (stiffness_at(0.1), "constant stiffness" in remark.text) == (1.0, True)


def test_a_chattering_program_has_no_decay_left(shop: Shop) -> None:
    shop.run(("A", 12900, 6))
    shop.tap_both()
    (verdict,) = shop.logbook.verdicts()
    assert find_tolerable_drop(verdict.samples, 6e-3, model_softening(verdict.assembly)[0]) == 0.0
