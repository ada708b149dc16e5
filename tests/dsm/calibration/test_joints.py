"""Joint and bearings together from two tools, and a third tool predicted from them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pytest

from dsm import (
    Bearing,
    Joint,
    PredictedMode,
    Segment,
    Spindle,
    StiffnessFit,
    StiffnessFitError,
    change_tool,
    fit_stiffness,
    natural_frequencies,
    predict_mode,
    receptance,
)
from dsm.calibration.stiffness_groups import scale_groups

HOLDER, TILTING = "holder", "holder tilting"
NOISE = 1e-3
"""Relative noise of every measured frequency."""
MODES = 3
"""Measured with each of the two tools."""


def tool(length: float, diameter: float) -> Spindle:
    """Carbide, with flutes."""
    segments = [Segment(0.4 * length, 0.85 * diameter, mass_diameter=0.9 * diameter), Segment(0.6 * length, diameter)]
    return Spindle(segments, (), youngs_modulus=6e11, density=14500, theory="timoshenko")


def tools(draw: np.random.Generator) -> list[Spindle]:
    """One spindle with a short, a long and a third tool between them, all of one joint and three bearings."""
    segments = [Segment(0.02, 0.045)] + [Segment(*draw.uniform([0.05, 0.055], [0.12, 0.085])) for _ in range(4)]
    length = sum(segment.length for segment in segments)
    places = np.array([0.18, 0.3, 0.85]) * length + draw.uniform(-0.02, 0.02, 3)
    stiffness = float(10 ** draw.uniform(8.0, 9.0))
    bearings = [Bearing(0.05 + float(place), stiffness) for place in places]
    joint = Joint(0.05, *(10 ** draw.uniform([7.5, 4.5], [9.0, 6.0])).tolist(), group=HOLDER, rotational_group=TILTING)
    drawn = Spindle([Segment(0.05, 0.02), *segments], bearings, theory="timoshenko", joints=[joint])
    lengths = draw.uniform([0.045, 0.08, 0.06], [0.06, 0.11, 0.085]).tolist()
    return [change_tool(drawn, 0.05, tool(one, float(draw.uniform(0.012, 0.02)))) for one in lengths]


def measured(spindles: Sequence[Spindle], count: int = MODES) -> dict[str, Any]:
    """Their exact frequencies, as fit_stiffness takes them."""
    frequency = np.concatenate([natural_frequencies(one, count) for one in spindles])
    return {
        "frequency": frequency,
        "frequency_std": NOISE * frequency,
        "mode": [*range(1, count + 1)] * len(spindles),
        "shaft": np.repeat(np.arange(len(spindles)), count).tolist(),
    }


def codes(fit: StiffnessFit) -> set[str]:
    return {remark.code for remark in fit.remarks}


def test_two_tools_tell_bearings_and_both_stiffnesses_of_the_joint() -> None:
    *two, third = tools(np.random.default_rng(4))
    away = {"bearings": 0.5, HOLDER: 2.0, TILTING: 0.6}
    start = [scale_groups(one, away) for one in (*two, third)]
    fit = fit_stiffness(start[:2], **measured(two))
    assert fit.groups == ("bearings", HOLDER, TILTING)
    assert fit.factor == pytest.approx([2.0, 0.5, 1 / 0.6], rel=1e-6)
    joint = two[0].joints[0]
    expected = [two[0].bearings[0].stiffness, joint.stiffness, joint.rotational_stiffness]
    assert fit.stiffness == pytest.approx(expected, rel=1e-6)
    assert [one.joints[0].rotational_stiffness for one in fit.spindles] == pytest.approx(expected[2:] * 2, rel=1e-6)
    found = predict_mode(fit, start[2])
    assert found.frequency == pytest.approx(natural_frequencies(third, 1)[0], rel=1e-6)
    assert f"stiffness {TILTING}" in str(fit)
    assert "N m/rad" in str(fit)


def test_shares_of_a_divided_joint_are_the_slopes_of_the_frequencies() -> None:
    one = tools(np.random.default_rng(5))[1]
    fit = fit_stiffness(one, natural_frequencies(one, 3))
    for column, name in enumerate(fit.groups):
        low, high = (natural_frequencies(scale_groups(one, {name: math.exp(step)}), 3) for step in (-1e-3, 1e-3))
        assert fit.energy_share[:, column] / 2 == pytest.approx(np.log(high / low) / 2e-3, abs=1e-5)


def test_the_error_of_a_prediction_is_what_noise_makes_of_it() -> None:
    """60 draws: their scatter is known to 9 %."""
    *two, third = tools(np.random.default_rng(4))
    exact, draw = measured(two), np.random.default_rng(6)
    fit = fit_stiffness(two, **exact)
    stated = predict_mode(fit, third)
    assert fit.log_covariance is not None
    factors = np.exp(draw.multivariate_normal(np.zeros(3), fit.log_covariance, 60))
    changed = [scale_groups(third, dict(zip(fit.groups, one, strict=True))) for one in factors.tolist()]
    assert stated.frequency_std is not None
    assert stated.frequency_std == pytest.approx(np.std([natural_frequencies(one, 1)[0] for one in changed]), rel=0.3)


@pytest.mark.parametrize("seed", [1, 3, 4, 9])
def test_a_joint_that_no_mode_feels_is_open(seed: int) -> None:
    """Ten thousand times as stiff as any: a remark, no number, and no failure for the noise."""
    *two, _ = tools(np.random.default_rng(4))
    rigid = [scale_groups(one, {HOLDER: 1e4, TILTING: 1e4}) for one in two]
    exact = measured(rigid)
    exact["frequency"] = exact["frequency"] * (1 + NOISE * np.random.default_rng(seed).normal(size=2 * MODES))
    fit = fit_stiffness(rigid, **exact)
    assert fit.open_groups == {HOLDER, TILTING}
    assert codes(fit) >= {"group-not-felt"}
    assert not fit.has_misfit
    (row,) = (line for line in str(fit).splitlines() if line.startswith(f"stiffness {HOLDER}  "))
    assert "factor" not in row
    assert fit.factor[0] == pytest.approx(1.0, abs=0.01)


def test_tools_of_two_spindles_do_not_fit_one() -> None:
    *two, _ = tools(np.random.default_rng(4))
    other = scale_groups(two[1], {"bearings": 0.95})
    fit = fit_stiffness(two, **measured([two[0], other]))
    assert fit.has_misfit
    assert "frequencies-misfit" in codes(fit)


@pytest.mark.parametrize("shaft", [None, [0, 0, 0, 0, 0, 0], [0, 0, 0, 1, 1, 2], [0, 1], [0.0, 0, 0, 1, 1, 1]])
def test_which_spindle_must_be_named(shaft: list[int] | None) -> None:
    *two, _ = tools(np.random.default_rng(4))
    with pytest.raises(ValueError, match=r"shaft=.* 0 to 1.* 6 modes"):
        fit_stiffness(two, **(measured(two) | {"shaft": shaft}))


class Outcome(NamedTuple):
    """Results of many simulated spindles."""

    inside: dict[str, list[bool]]
    """True for each 95 % interval of a closed stiffness that contains the truth, by group."""
    frequency: list[float]
    """Error of f_1 of the third tool, relative."""
    peak: list[float]
    """Error of the largest |H| of the third tool, relative."""
    stated: list[bool]
    """True for each f_1 of the third tool within twice its standard error."""
    failed: int
    """Fits that found nothing."""


def study(number: int, seed: int) -> Outcome:
    """Three modes of two tools with 0.1 % noise; starts off by a factor of 2, one standard deviation."""
    draw, found = np.random.default_rng(seed), Outcome({}, [], [], [], 0)
    for _ in range(number):
        *two, third = tools(draw)
        exact = measured(two)
        exact["frequency"] = exact["frequency"] * (1 + NOISE * draw.normal(size=2 * MODES))
        away = dict(zip(("bearings", HOLDER, TILTING), np.exp(0.7 * draw.normal(size=3)).tolist(), strict=True))
        try:
            fit = fit_stiffness([scale_groups(one, away) for one in two], **exact)
        except (StiffnessFitError, ValueError):
            found = found._replace(failed=found.failed + 1)
            continue
        assert fit.log_covariance is not None
        error = np.log(fit.factor * list(away.values())) / np.sqrt(np.diag(fit.log_covariance))
        for name, one in zip(fit.groups, error.tolist(), strict=True):
            if name not in fit.open_groups:
                found.inside.setdefault(name, []).append(abs(one) < 1.96)
        compare(found, third, fit.apply_to(scale_groups(third, away)), predict_mode(fit, scale_groups(third, away)))
    return found


def compare(found: Outcome, truth: Spindle, model: Spindle, stated: PredictedMode) -> None:
    first = float(natural_frequencies(truth, 1)[0])
    lines = np.linspace(0.5 * first, 2.5 * first, 1500)
    peaks = [float(np.max(np.abs(receptance(one, lines, loss_factor=0.06)))) for one in (truth, model)]
    found.frequency.append(abs(stated.frequency / first - 1))
    found.peak.append(abs(peaks[1] / peaks[0] - 1))
    found.stated.append(abs(stated.frequency - first) < 1.96 * (stated.frequency_std or 0.0))


def test_a_third_tool_is_predicted() -> None:
    found = study(1, 11)
    assert found.failed == 0
    assert max(found.frequency) < 0.01
    assert max(found.peak) < 0.05


@pytest.mark.long
@pytest.mark.parametrize(("number", "seed"), [(60, 1), (75, 2)])
def test_joints_lie_in_their_intervals_and_third_tools_are_predicted(number: int, seed: int) -> None:
    found = study(number, seed)
    joint = [*found.inside[HOLDER], *found.inside[TILTING]]
    assert 0.92 <= np.mean(joint) <= 0.98
    assert np.mean(np.array(found.frequency) < 0.01) > 0.98
    assert np.mean(np.array(found.peak) < 0.05) > 0.95
    assert found.failed == 0
    assert len(joint) > 1.4 * number
