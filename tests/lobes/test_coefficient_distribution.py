"""Joint distribution of Kt and Kr/Kt of listed materials: quantiles against the rows of its sources, correlation."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import ndtri
from scipy.stats import spearmanr

from lobes import CuttingCoefficients, all_cutting_coefficients, fold_material_name, materials_by_name
from lobes.coefficient_distribution import (
    COEFFICIENT_CORRELATION,
    JointCoefficients,
    Quantiles,
    pool_intervals,
)
from lobes.materials import find_joint_coefficients

pytestmark = pytest.mark.quick

LISTED = [known for known in all_cutting_coefficients() if known.specific_forces]
TESTS = [known for known in all_cutting_coefficients() if not known.specific_forces]


def joint_of(known: CuttingCoefficients) -> JointCoefficients:
    joint = find_joint_coefficients(known)
    assert joint is not None
    return joint


def named(name: str) -> JointCoefficients:
    return joint_of(materials_by_name()[fold_material_name(name)])


def share_below(joint: JointCoefficients, force: float) -> float:
    """Probability of a smaller Kt (Pa)."""
    return float(np.interp(force, joint.tangential.values, joint.tangential.probabilities))


def test_each_publication_of_42crmo4_has_a_quarter_of_the_probability_and_so_has_the_error_of_one() -> None:
    """Rows 1725/0.24, 1900/0.25 and 2500/0.26 at 0.05 to 0.2 mm by hand, and a quarter to each side of their mean."""
    rows = [(1725e6, 0.24), (1900e6, 0.25), (2500e6, 0.26)]
    mean = np.mean([(1 - mc) * kc * 0.1**-mc for kc, mc in rows])
    ends = [((1 - mc) * kc * 0.2**-mc, (1 - mc) * kc * 0.05**-mc) for kc, mc in rows] + [(0.75 * mean, 1.25 * mean)]
    for force in (2.0e9, 2.4e9, 2.8e9, 3.2e9, 3.8e9):
        by_hand = np.mean([np.clip((force - low) / (high - low), 0, 1) for low, high in ends])
        assert share_below(named("42CrMo4"), force) == pytest.approx(by_hand, abs=1e-9)


def test_the_upper_tail_of_titanium_is_that_of_its_largest_source() -> None:
    low, high = 0.78 * 2110e6 * 0.2**-0.22, 0.78 * 2110e6 * 0.05**-0.22
    assert 1 - share_below(named("TiAl6V4"), 3.0e9) == pytest.approx((high - 3.0e9) / (high - low) / 4)
    assert named("TiAl6V4").tangential.values[-1] == pytest.approx(high)


def test_a_single_source_is_even_within_its_error_where_that_is_larger_than_the_effect_of_the_chip() -> None:
    joint, kt = named("AISI 304"), 0.8 * 2150e6 * 0.1**-0.20
    thick, thin = 0.8 * 2150e6 * 0.2**-0.20, 0.8 * 2150e6 * 0.05**-0.20
    assert joint.tangential.at(np.array([0.0, 1.0])) == pytest.approx([0.75 * kt, 1.25 * kt])
    within = (thick - 0.75 * kt) / (0.5 * kt) / 2
    assert share_below(joint, thick) == pytest.approx(within)
    assert 1 - share_below(joint, thin) == pytest.approx((1.25 * kt - thin) / (0.5 * kt) / 2)


def test_a_milling_test_is_a_step_of_its_weight() -> None:
    """Two groups, four tests and the error of a single source: seven of equal weight."""
    for test in (known for known in TESTS if known.alloy == "Al 7075"):
        below, above = (share_below(named("EN AW-7075"), test.tangential + side * 10.0) for side in (-1, 1))
        assert above - below == pytest.approx(1 / 7, abs=1e-6)


def test_ends_and_median_are_those_of_the_list() -> None:
    for known in LISTED:
        joint, ends = joint_of(known), np.array([0.0, 1.0])
        assert tuple(joint.tangential.at(ends)) == known.tangential_range, known.material
        assert tuple(joint.ratio.at(ends)) == known.ratio_range, known.material
        assert float(joint.ratio.at(np.array([0.5]))[0]) == pytest.approx(known.radial / known.tangential)


def test_the_correlation_is_that_of_the_only_alloy_with_several_tests() -> None:
    tests = [known for known in TESTS if known.alloy == "Al 7075"]
    forces = [known.tangential for known in tests]
    measured = spearmanr(forces, [known.radial / known.tangential for known in tests]).statistic
    assert pytest.approx(measured) == COEFFICIENT_CORRELATION
    assert {joint_of(known).correlation for known in LISTED} == {COEFFICIENT_CORRELATION}


@pytest.mark.parametrize("correlation", [-0.6, 0.0, COEFFICIENT_CORRELATION, 0.9])
def test_both_are_above_their_medians_as_often_as_the_normal_orthant_says(correlation: float) -> None:
    """1/4 + asin(r) / 2 pi (Sheppard 1899), with the normal correlation r = 2 sin(pi rank / 6)."""
    even = np.random.default_rng(0).uniform(size=(2, 40_000))
    joint = JointCoefficients(Quantiles.even(1.0, 2.0), Quantiles.even(0.2, 0.4), correlation)
    force, ratio = joint.at(even)
    orthant = 0.25 + np.arcsin(2 * np.sin(np.pi * correlation / 6)) / (2 * np.pi)
    assert np.mean((force > 1.5) & (ratio > 0.3)) == pytest.approx(orthant, abs=0.008)
    assert spearmanr(force, ratio).statistic == pytest.approx(correlation, abs=0.02)
    assert np.quantile(ratio, [0.1, 0.5, 0.9]) == pytest.approx([0.22, 0.3, 0.38], abs=0.003)


def test_a_normal_number_of_the_ratio_is_the_weighted_sum_of_both() -> None:
    even = np.array([[0.9, 0.1], [0.5, 0.7]])
    weight = 2 * np.sin(np.pi * 0.4 / 6)
    shares = named("C45").shares(even)
    assert shares[0] == pytest.approx(even[0])
    expected = weight * ndtri(even[0]) + np.sqrt(1 - weight**2) * ndtri(even[1])
    assert ndtri(shares[1]) == pytest.approx(expected)


@given(
    st.lists(st.tuples(st.floats(1e8, 4e9), st.floats(0.0, 2e9)), min_size=1, max_size=6),
    st.floats(1e-3, 1e3),
    st.floats(0.0, 1.0),
)
def test_pooling_rises_between_the_ends_and_moves_with_the_unit(
    sources: list[tuple[float, float]], unit: float, share: float
) -> None:
    intervals = [(low, low + width) for low, width in sources]
    pooled = pool_intervals(intervals)
    assert np.all(np.diff(pooled.values) > 0)
    assert (pooled.probabilities[0], pooled.probabilities[-1]) == pytest.approx((0.0, 1.0))
    assert pooled.values[0] == min(low for low, _ in intervals)
    assert pooled.over(unit).at(np.array([share])) == pytest.approx(pooled.at(np.array([share])) / unit)


def test_a_mixture_has_the_weighted_probabilities() -> None:
    mixed = Quantiles.even(0.2, 0.4).mix(Quantiles.even(0.0, 1.0), 0.3)
    assert np.interp([0.1, 0.3, 0.7], mixed.values, mixed.probabilities) == pytest.approx(
        [0.03, 0.7 * 0.5 + 0.3 * 0.3, 0.7 + 0.3 * 0.7]
    )
