"""Stiffnesses and third tools from a drawing whose diameters are slightly wrong."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from dsm import Segment, Spindle, StiffnessFitError, fit_stiffness, natural_frequencies, predict_mode
from dsm.calibration.stiffness_groups import scale_groups
from tests.dsm.calibration.test_joints import HOLDER, MODES, NOISE, TILTING, measured, tools

TOOL_SEGMENTS = 2
Wrong = Callable[[Sequence[Spindle], np.random.Generator], list[Spindle]]


def scaled(segment: Segment, factor: float) -> Segment:
    mass = None if segment.mass_diameter is None else segment.mass_diameter * factor
    return replace(segment, outer_diameter=segment.outer_diameter * factor, mass_diameter=mass)


def with_diameters(spindle: Spindle, factors: Sequence[float]) -> Spindle:
    return replace(spindle, segments=[scaled(*pair) for pair in zip(spindle.segments, factors, strict=True)])


def each_diameter_off(spindles: Sequence[Spindle], draw: np.random.Generator) -> list[Spindle]:
    """By 1 % (one standard deviation), those of the spindle by the same with every tool."""
    body = 1 + 0.01 * draw.normal(size=len(spindles[0].segments) - TOOL_SEGMENTS)
    return [with_diameters(one, [*(1 + 0.01 * draw.normal(size=TOOL_SEGMENTS)), *body]) for one in spindles]


def one_tool_off(spindles: Sequence[Spindle], draw: np.random.Generator) -> list[Spindle]:
    """One of the first two tools, thicker or thinner by 5 %."""
    wrong, factor = int(draw.integers(0, 2)), 1 + 0.05 * float(draw.choice([-1, 1]))
    rest = [1.0] * (len(spindles[0].segments) - TOOL_SEGMENTS)
    return [
        with_diameters(one, [factor if number == wrong else 1.0] * TOOL_SEGMENTS + rest)
        for number, one in enumerate(spindles)
    ]


class Outcome(NamedTuple):
    """Results of many simulated spindles."""

    joint: list[bool]
    """True for each 95 % interval of a closed joint stiffness that contains the truth."""
    third: list[bool]
    """True for each f_1 of the third tool within 1.96 times its standard error."""
    misfits: int
    """Fits whose frequencies do not fit one spindle, and those that found nothing; not counted."""


def study(number: int, wrong: Wrong, tolerance: float) -> Outcome:
    draw, outcome = np.random.default_rng(1), Outcome([], [], 0)
    for _ in range(number):
        drawn = tools(draw)
        *two, third = wrong(drawn, draw)
        taps = measured(two)
        taps["frequency"] = taps["frequency"] * (1 + NOISE * draw.normal(size=2 * MODES))
        away = dict(zip(("bearings", HOLDER, TILTING), np.exp(0.7 * draw.normal(size=3)).tolist(), strict=True))
        try:
            fit = fit_stiffness([scale_groups(one, away) for one in drawn[:2]], **taps, tolerance=tolerance)
        except (StiffnessFitError, ValueError):
            outcome = outcome._replace(misfits=outcome.misfits + 1)
            continue
        if fit.has_misfit:
            outcome = outcome._replace(misfits=outcome.misfits + 1)
            continue
        assert fit.log_covariance is not None
        error = np.log(fit.factor * list(away.values())) / np.sqrt(np.diag(fit.log_covariance))
        known = {name: abs(one) < 1.96 for name, one in zip(fit.groups, error.tolist(), strict=True)}
        outcome.joint.extend(inside for name, inside in known.items() if name in {HOLDER, TILTING} - fit.open_groups)
        stated = predict_mode(fit, scale_groups(drawn[2], away))
        off = abs(stated.frequency - float(natural_frequencies(third, 1)[0]))
        outcome.third.append(off < 1.96 * (stated.frequency_std or 0.0))
    return outcome


def test_a_tolerance_widens_intervals_and_predictions_and_nothing_else() -> None:
    *two, third = tools(np.random.default_rng(4))
    exact, drawn = (fit_stiffness(two, **measured(two), tolerance=tolerance) for tolerance in (0.0, 0.01))
    assert drawn.factor == pytest.approx(exact.factor, rel=1e-6)
    assert exact.factor_std is not None
    assert drawn.factor_std is not None
    assert np.all(drawn.factor_std > 2 * exact.factor_std)
    sharp, wide = predict_mode(exact, third), predict_mode(drawn, third)
    assert wide.frequency == pytest.approx(sharp.frequency, rel=1e-6)
    assert (wide.frequency_std or 0.0) > 2 * (sharp.frequency_std or 1.0)
    assert (wide.stiffness_std or 0.0) > 2 * (sharp.stiffness_std or 1.0)


def test_joints_and_a_third_tool_hold_with_a_drawing_that_is_slightly_wrong() -> None:
    found = study(4, each_diameter_off, 0.01)
    assert found.misfits == 0
    assert np.mean(found.joint) > 0.7
    assert np.mean(found.third) > 0.7


@pytest.mark.long
@pytest.mark.timeout(1800)
@pytest.mark.parametrize(("wrong", "least"), [(each_diameter_off, 0.9), (one_tool_off, 0.85)])
def test_intervals_of_joints_hold_with_a_drawing_that_is_wrong(wrong: Wrong, least: float) -> None:
    found = study(100, wrong, 0.01)
    assert np.mean(found.joint) >= least
    assert np.mean(found.third) >= least
