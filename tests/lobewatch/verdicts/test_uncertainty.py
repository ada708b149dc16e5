"""Samples left by test cuts are the mean times the factors of each."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
from scipy.stats import spearmanr

from lobes import Cut, MillingRows, Program, materials_by_name
from lobes.materials import find_joint_coefficients
from lobewatch.machine.settings.machine_file import parse_machine_file
from lobewatch.tool.assembly import Assembly
from lobewatch.verdicts.program_samples import ProgramSamples, build_median_row, draw_rotating_samples
from lobewatch.verdicts.uncertainty import LearnedSamples, Uncertainty, uncertainty_of
from lobewatch.verdicts.uncertainty_causes import TEST_CUTS
from modal import Mode
from tests.lobewatch.conftest import Shop

DRAWS = LearnedSamples(
    frequency=np.array([[0.9, 0.8], [1.1, 1.2]]),
    damping_ratio=np.array([[0.7, 0.6], [1.3, 1.4]]),
    stiffness=np.array([[0.5, 0.4], [1.5, 1.6]]),
    phase_change=np.array([[0.1, -0.2], [-0.1, 0.2]]),
    tangential=np.array([0.8, 1.2]),
    ratio=np.array([0.9, 1.1]),
)


@pytest.fixture
def middle(shop: Shop) -> MillingRows:
    """One mode in x and one in y, a slot."""
    shop.tap_both()
    assembly = replace(shop.logbook.assembly(), x=[Mode(1700.0, 0.03, 3e7)], y=[Mode(1500.0, 0.02, 2e7)])
    return build_median_row(Program(Cut(4, 1.0, "down", 1400e6, 500e6), 12000.0, 1e-3), assembly)


def test_each_draw_is_the_middle_times_its_own_factors(middle: MillingRows) -> None:
    rows = DRAWS.build_rows(middle, 3, "")
    of_draw = [0, 1, 0]
    assert rows.frequency == pytest.approx(middle.frequency * DRAWS.frequency[of_draw])
    assert rows.damping_ratio == pytest.approx(middle.damping_ratio * DRAWS.damping_ratio[of_draw])
    assert rows.stiffness == pytest.approx(middle.stiffness * DRAWS.stiffness[of_draw])
    assert rows.phase == pytest.approx(middle.phase + DRAWS.phase_change[of_draw])
    assert rows.tangential == pytest.approx(1400e6 * DRAWS.tangential[of_draw])
    assert rows.radial == pytest.approx(500e6 * (DRAWS.tangential * DRAWS.ratio)[of_draw])


def test_what_is_taken_as_known_stays_in_the_middle(middle: MillingRows) -> None:
    without_cuts, without_coefficients = (
        DRAWS.build_rows(middle, 2, TEST_CUTS.name),
        DRAWS.build_rows(middle, 2, "coefficients"),
    )
    assert without_cuts.frequency == pytest.approx(np.tile(middle.frequency, (2, 1)))
    assert without_cuts.phase == pytest.approx(np.tile(middle.phase, (2, 1)))
    assert without_cuts.tangential == pytest.approx(1400e6 * DRAWS.tangential)
    assert without_coefficients.stiffness == pytest.approx(middle.stiffness * DRAWS.stiffness)
    assert without_coefficients.tangential == pytest.approx([1400e6, 1400e6])
    assert without_coefficients.radial == pytest.approx([500e6, 500e6])


def test_a_prediction_is_doubted_as_machine_toml_says(shop: Shop) -> None:
    shop.tap_both()
    machine, tapped = shop.logbook.machine, shop.logbook.assembly()
    predicted = replace(
        tapped, x=[Mode(1700.0, 0.03, 3e7, phase_deg=10.0)], y=[Mode(1500.0, 0.02, 2e7)], predicted=True
    )
    widths = uncertainty_of(predicted, machine.program[0], machine).modes["prediction"]
    given = machine.doubt
    percents = [given.predicted_frequency_percent, given.predicted_damping_percent, given.predicted_stiffness_percent]
    assert widths[:, :3] == pytest.approx(np.tile(np.array(percents) / 100, (2, 1)))
    assert widths[:, 3] == pytest.approx([np.radians(10.0), 0.0])


LISTED = (
    '[machine]\nname = "m"\n[[program]]\nname = "listed"\nteeth = 4\nradial_depth_mm = 6\ntool_diameter_mm = 12\n'
    'speed_rpm = 9000\ndepth_mm = 1\ndirection = "down"\nmaterial = "42CrMo4"\n'
)
STATED = "tangential_n_per_mm2 = 2000\nradial_n_per_mm2 = 600\n"
X, Y = [Mode(1700.0, 0.03, 3e7)], [Mode(1500.0, 0.02, 2e7)]
TOOL = Assembly("reference", datetime(2026, 1, 1, tzinfo=UTC), "drawn", X, Y, ("x", "y"), None, {}, False, ())
MEDIAN = build_median_row(Program(Cut(4, 0.5, "down", 1e9, 3e8), 9000.0, 1e-3), TOOL)


def doubt_of_listed(more: str = "") -> Uncertainty:
    """Return the uncertainty of a program in 42CrMo4 with more keys."""
    machine = parse_machine_file(LISTED + more)
    return uncertainty_of(TOOL, machine.program[0], machine)


def test_kt_and_kr_of_a_listed_material_follow_its_joint_distribution() -> None:
    doubt, known = doubt_of_listed(), materials_by_name()["42crmo4"]
    rows, joint = doubt.sample(MEDIAN, 4000), find_joint_coefficients(known)
    assert joint is not None
    force = rows.tangential / MEDIAN.tangential * known.tangential
    ratio = rows.radial / rows.tangential * MEDIAN.tangential / MEDIAN.radial * known.radial / known.tangential
    shares = np.array([0.05, 0.25, 0.5, 0.75, 0.95])
    assert np.quantile(force, shares) == pytest.approx(joint.tangential.at(shares), rel=0.02)
    assert np.quantile(ratio, shares) == pytest.approx(joint.ratio.at(shares), rel=0.04)
    assert spearmanr(force, ratio).statistic == pytest.approx(joint.correlation, abs=0.05)


def test_stated_coefficients_stay_even_within_their_percents_and_apart() -> None:
    doubt = doubt_of_listed(STATED)
    rows = doubt.sample(MEDIAN, 4000)
    force, ratio = (
        rows.tangential / MEDIAN.tangential,
        rows.radial / rows.tangential * MEDIAN.tangential / MEDIAN.radial,
    )
    assert doubt.joint is None
    assert np.quantile(force, [0, 0.5, 1]) == pytest.approx([0.8, 1.0, 1.2], abs=0.01)
    assert np.quantile(ratio, [0, 0.5, 1]) == pytest.approx([0.8, 1.0, 1.2], abs=0.01)
    assert abs(spearmanr(force, ratio).statistic) < 0.05


@pytest.mark.parametrize("stated", ["", STATED])
def test_the_largest_wear_comes_with_the_largest_kt(stated: str) -> None:
    doubt = doubt_of_listed('wear = "worn"\n' + stated)
    sharp, worn = (doubt.sample(MEDIAN, 2000, without=cause).tangential for cause in ("wear", ""))
    assert np.quantile(worn / sharp, [0, 0.5, 1]) == pytest.approx([1.0, 1.3, 1.6], abs=0.002)
    assert spearmanr(worn / sharp, sharp).statistic == pytest.approx(1.0)


@pytest.mark.parametrize(("stated", "spread"), [("", 0.1), (STATED, 0.3)])
def test_the_chance_of_chatter_varies_kt_of_a_listed_material_less(stated: str, spread: float) -> None:
    doubt = doubt_of_listed(stated)
    samples = ProgramSamples(doubt.sample(MEDIAN, 4000), (Cut(4, 1.0, "down", 1e9, 3e8),), np.full(1, np.inf), 1, doubt)
    push = draw_rotating_samples(samples).rows.tangential / samples.rows.tangential
    assert np.mean(push) == pytest.approx(1.0, abs=0.02)
    assert np.std(push) == pytest.approx(spread, rel=0.05)
