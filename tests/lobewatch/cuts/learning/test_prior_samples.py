"""Prior in closed form: samples at one standard deviation, and the rows of their cuts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ndtr

from lobes import build_milling_system, materials_by_name, rows_at_speeds
from lobes.materials import find_joint_coefficients
from lobewatch.cuts.learning.posterior import build_prior
from lobewatch.cuts.learning.prior_samples import SpindleSamples
from lobewatch.verdicts.speed_drop import SpeedDrop
from lobewatch.verdicts.uncertainty import FactorRange, Uncertainty
from modal import Mode
from tests.lobewatch.cuts.learning.conftest import Mill

pytestmark = pytest.mark.quick

KR_OVER_KT = FactorRange(0.5, 1.1)


def draws(*rows: dict[int, float], ratio: FactorRange = KR_OVER_KT) -> SpindleSamples:
    """Return samples at the prior centre, shifted by standard deviations; ratio: uncertainty of Kr/Kt."""
    middle = Mill().prior.samples[: len(rows)]
    middle.normal[:] = 0.0
    for number, row in enumerate(rows):
        for place, deviations in row.items():
            middle.normal[number, place] = deviations
    return replace(middle, uncertainty=replace(middle.uncertainty, ratio=ratio))


def test_the_middle_of_the_prior_is_a_slower_softer_damped_spindle_and_a_harder_cut() -> None:
    middle = {name: values[0] for name, values in draws({}).ratios().items()}
    assert middle == pytest.approx(
        {
            "frequency_x": 0.975, "damping_x": 1.1, "stiffness_x": 1.0,
            "frequency_y": 0.975, "damping_y": 1.1, "stiffness_y": 1.0,
            "tangential": 1.1, "ratio": pytest.approx(0.85, abs=0.001),
        }
    )  # fmt: skip


def test_the_middle_of_each_mode_drops_by_its_share() -> None:
    middle = replace(draws({}), drop=SpeedDrop(0.01, 0.03, np.array([1.0, 2.0]))).ratios()
    assert (middle["frequency_x"][0], middle["frequency_y"][0]) == pytest.approx((0.98, 0.96))


def test_wear_raises_kt_most_where_it_is_largest() -> None:
    sharp = draws({7: -99.0}, {}, {7: 99.0})
    worn = replace(sharp, uncertainty=replace(sharp.uncertainty, wear=1.6))
    assert worn.force_factors(0) / sharp.force_factors(0) == pytest.approx([1.0, 1.3, 1.6])
    assert worn.ratios()["ratio"] == pytest.approx(sharp.ratios()["ratio"])


@pytest.mark.parametrize(("side", "first"), [("x", 2), ("y", 4)])
def test_a_standard_deviation_is_25_percent_of_damping_and_10_of_stiffness(side: str, first: int) -> None:
    ratios = draws({first: 1.0}, {first + 1: -1.0}, {first: -9.0}, {first + 1: -99.0}).ratios()
    assert ratios[f"damping_{side}"] == pytest.approx([1.1 * 1.25, 1.1, 1.1 * 0.1, 1.1])
    assert ratios[f"stiffness_{side}"] == pytest.approx([1.0, 0.9, 1.0, 0.1])
    unmoved = [name for name, values in ratios.items() if np.ptp(values) == 0]
    assert len(unmoved) == 6


@pytest.mark.parametrize(("side", "first"), [("x", 0), ("y", 1)])
@pytest.mark.parametrize("deviations", [-2.0, -0.5, 1.0, 3.5])
def test_one_frequency_in_twenty_is_three_times_as_far_off(side: str, first: int, deviations: float) -> None:
    """Quantiles of the mixture of 95 % with a standard deviation of 2 % and 5 % with 6 %."""
    factor = draws({first: deviations}).ratios()[f"frequency_{side}"][0]
    off = (factor - 0.975) / 0.02
    assert 0.95 * ndtr(off) + 0.05 * ndtr(off / 3) == pytest.approx(ndtr(deviations), rel=1e-3, abs=1e-6)


def test_kt_is_drawn_at_speed_and_as_uncertain() -> None:
    ratios = draws({6: 1.0}, {7: 1.0}, {8: 1.0}, {6: -9.0}).ratios()
    doubted = 0.8 + 0.4 * ndtr(1.0)
    assert ratios["tangential"] == pytest.approx([1.1 * 1.3, 1.1 * doubted, 1.1, 1.1 * 0.1])
    assert ratios["ratio"][:2] == pytest.approx(ratios["ratio"][[3, 3]])


def test_a_listed_material_is_drawn_from_its_joint_distribution_and_10_percent_at_speed() -> None:
    known = materials_by_name()["42crmo4"]
    joint = find_joint_coefficients(known)
    assert joint is not None
    factors = joint.over(known.tangential, 5e8 / 1.4e9)
    drawn = draws({6: 1.0}, {7: 1.0}, {8: 1.0}, {7: 1.0, 8: -1.0}, {7: 60.0})
    ratios = replace(drawn, uncertainty=replace(drawn.uncertainty, joint=factors)).ratios()
    middle, more, most = factors.tangential.at(np.array([0.5, ndtr(1.0), 1.0]))
    expected = [1.1 * middle, more, middle, more, most]
    assert ratios["tangential"] == pytest.approx(1.1 * np.array(expected))
    weight = 2 * np.sin(np.pi * joint.correlation / 6)
    normal = np.array([0.0, weight, np.sqrt(1 - weight**2), weight - np.sqrt(1 - weight**2)])
    below = np.interp(ratios["ratio"], factors.ratio.values, factors.ratio.probabilities)
    mixed = 0.7 * below + 0.3 * np.clip(ratios["ratio"] * 5 / 14, 0, 1)
    assert mixed[:4] == pytest.approx(ndtr(normal))
    assert np.all(np.isfinite(ratios["ratio"]))


@pytest.mark.parametrize("span", [KR_OVER_KT, FactorRange(-0.2, 0.5), FactorRange(2.0, 4.0), FactorRange(1.0, 1.0)])
@pytest.mark.parametrize("deviations", [-3.0, -0.7, 0.0, 1.3, 2.5])
def test_kr_over_kt_is_as_uncertain_or_with_30_percent_anything_from_0_to_1(
    span: FactorRange, deviations: float
) -> None:
    """Quantiles of the mixture; Kr/Kt of the slot is 5/14."""
    drawn = draws({8: deviations}, ratio=span).ratios()["ratio"][0]
    assert 0 <= drawn <= max(2.8, span.high)
    width = max(span.high - span.low, 1e-9)
    below = 0.7 * np.clip((drawn - span.low) / width, 0, 1) + 0.3 * np.clip(drawn * 5 / 14, 0, 1)
    if drawn > 0 and span.high > span.low:
        assert below == pytest.approx(ndtr(deviations))


def test_without_radial_force_kr_over_kt_stays_as_uncertain() -> None:
    bare = Mill(cut=replace(Mill().cut, radial=0.0)).prior.samples
    ratios = bare.ratios()["ratio"]
    assert np.min(ratios) > 0.8
    assert np.max(ratios) < 1.2
    assert np.all(bare.build_rows(9000.0, 1.4e9, 0.0).radial == 0)


def test_each_mode_has_its_own_frequency_and_both_of_a_direction_one_damping() -> None:
    """The mode that gives way most is the first of its direction, wherever it stands."""
    x = [Mode(3100.0, 0.03, 9e7), Mode(1713.0, 0.029, 3.5e7)]
    middle = rows_at_speeds(build_milling_system(x, [Mode(1400.0, 0.035, 2.5e7)]), Mill().cut, np.ones(1))
    drawn = build_prior(
        middle, Uncertainty({}, np.zeros((0, 4, 4)), 0.01, FactorRange(0.8, 1.2), FactorRange(0.8, 1.2)), 3
    ).samples
    drawn.normal[:] = 0.0
    drawn.normal[0, 0], drawn.normal[1, 1], drawn.normal[2, 3] = -1.0, 1.0, 1.0
    ratios, rows = drawn.ratios(), drawn.build_rows(9000.0, 1.4e9, 5e8)
    assert (ratios["frequency_x_2"][0] < 0.975, ratios["frequency_x"][0]) == (True, pytest.approx(0.975))
    assert (ratios["frequency_x"][1] > 0.975, ratios["frequency_x_2"][1]) == (True, pytest.approx(0.975))
    at_rest = 2 * np.pi * np.array([3100.0, 1713.0, 1400.0])
    factors = [ratios[name] for name in ("frequency_x_2", "frequency_x", "frequency_y")]
    assert rows.frequency / at_rest == pytest.approx(np.array(factors).T)
    assert rows.damping_ratio[2] == pytest.approx(1.1 * np.array([1.25 * 0.03, 1.25 * 0.029, 0.035]))
    assert rows.stiffness[2] == pytest.approx([9e7, 3.5e7, 2.5e7])


def test_rows_cut_with_the_coefficients_of_their_material_and_turn_at_the_speed_asked_for() -> None:
    both = draws({0: 1.0, 4: 1.0}, {5: 1.0}).with_materials(2, 0)
    both.normal[:, 9:] = [[1.0, 0.0, 1.0], [0.0, 0.0, 0.0]]
    ratios, rows = both.ratios(), both.build_rows(9000.0, 1.4e9, 5e8)
    sides = ["xy"[axis] for axis in rows.axes[rows.direction]]
    assert sorted(sides) == ["x", "y"]
    for column, side in enumerate(sides):
        mode = getattr(Mill(), side)
        frequency = 2 * np.pi * mode.frequency * ratios[f"frequency_{side}"]
        assert rows.frequency[:, column] == pytest.approx(frequency)
        assert rows.damping_ratio[:, column] == pytest.approx(mode.damping_ratio * ratios[f"damping_{side}"])
        assert rows.stiffness[:, column] == pytest.approx(mode.stiffness * ratios[f"stiffness_{side}"])
    assert rows.speed_rpm.tolist() == [9000.0, 9000.0]
    assert rows.tangential == pytest.approx([1.4e9 * 1.1] * 2)
    assert rows.radial == pytest.approx(5e8 * 1.1 * ratios["ratio"])
    wide = draws({8: 1.0}, {}).ratios()["ratio"]
    steel = both.build_rows(9000.0, 1.4e9, 5e8, 1)
    assert steel.tangential == pytest.approx([1.4e9 * 1.1 * 1.3, 1.4e9 * 1.1])
    assert steel.radial == pytest.approx([5e8 * 1.1 * 1.3 * wide[0], 5e8 * 1.1 * wide[1]])


def test_a_mode_that_is_drawn_still_rings() -> None:
    both = draws({2: 200.0}, {})
    assert both.build_rows(9000.0, 1.4e9, 5e8).damping_ratio[0].tolist()[:1] == [0.95]


def test_a_new_material_leaves_what_was_drawn_as_it_is() -> None:
    known = Mill().prior.samples[:40]
    more = known.with_materials(3, 0)
    assert more.normal.shape == (40, 6 + 3 * 3)
    assert np.array_equal(more.normal[:, :9], known.normal)
    assert abs(np.std(more.normal[:, 9:]) - 1) < 0.15
    assert more.with_materials(2, 0) is more
    assert np.array_equal(known.with_materials(3, 0).normal, more.normal)
