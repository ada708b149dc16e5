"""Comparison with the paper against numbers measured earlier by other means."""

from __future__ import annotations

import math

import numpy as np
import pytest

from dsm import natural_frequencies
from lobewatch.paper import PaperStudy, printed
from lobewatch.paper.shaft_study import surrogate_spindle

MEASURED = {
    "f1, rigid bearings": 2301.09,
    "f1 at 1.28e9 N/m": 1713.05,
    "f1 at 7.72e8 N/m": 1582.08,
    "each bearing, for 1722 Hz": 1.3268e9,
    "each bearing, for 1550 Hz": 6.863e8,
    "critical speed, rigid": 138065,
    "critical speed, 1722 Hz": 103320,
    "f1, cubic without shear": 2301.092,
    "f1, cubic with shear": 2034.57,
    "first root with the sign of (5)": 3.206941,
    "omega_A": 1671.07,
    "omega_B": 1771.46,
    "zeta, picked": 0.029165,
    "D = Im G(f1)": -5.3148e-7,
    "K_exp, picked": 3.2250e7,
    "K_theo by the rule 0.9 K_exp": 2.90601e7,
    "K_theo by (30) to (36)": 2.7393e7,
    "K static, new": 2.9368e7,
    "K of mode 1, old over new": 0.9856,
    "b_lim Ks mu Nt*, new": 1936365,
    "b_lim Ks mu Nt*, old": 1742729,
    "lowest limit, old over new": 0.9,
    "modal mass, new": 0.27582,
}
"""Each by a script of its own, before the command was there (1 % of its last digit or better)."""


def numbers(study: PaperStudy) -> dict[str, float]:
    """Ours by quantity; of those of one name the first."""
    rows = [row for section in study.sections for row in section.comparisons]
    return {row.quantity: row.ours for row in reversed(rows)}


@pytest.mark.parametrize("quantity", MEASURED)
def test_the_number_is_the_one_that_was_measured(study: PaperStudy, quantity: str) -> None:
    assert numbers(study)[quantity] == pytest.approx(MEASURED[quantity], rel=6e-5)


def test_every_number_has_a_value_and_a_reason(study: PaperStudy) -> None:
    for section in study.sections:
        for row in section.comparisons:
            assert math.isfinite(row.ours), row
            assert row.reason, row
            assert row.printed is None or row.printed > 0, row


def test_every_printed_number_is_in_the_table(study: PaperStudy) -> None:
    """Each constant of `printed` but the count of elements, which names a row."""
    shown = {row.printed for section in study.sections for row in section.comparisons}
    constants = {value for name, value in vars(printed).items() if name.isupper() and name != "FEM_ELEMENTS"}
    assert constants <= shown
    assert any(f"{printed.FEM_ELEMENTS} elements" in quantity for quantity in numbers(study))


def test_the_rule_is_k_theo_to_every_digit() -> None:
    assert f"{0.9 * printed.STIFFNESS:.5e}" == f"{printed.OLD_STIFFNESS:.5e}"


def test_the_curve_of_figure_8_is_that_of_the_frequencies(study: PaperStudy) -> None:
    stiffness, frequency = study.plain.curve
    for i in (0, 150, -1):
        assert natural_frequencies(surrogate_spindle(stiffness[i]), 1)[0] == pytest.approx(frequency[i], rel=1e-8)


def test_the_words_on_claims_follow_from_the_numbers(study: PaperStudy) -> None:
    """Check the condition of each claim on the numbers again."""
    words = [claim.verdict for claim in study.claims]
    assert words == ["fails", "holds", "holds in part", "holds in part", "fails", "holds", "holds in part"]
    assert study.meshes.at("linear") < study.plain.rigid_frequency < printed.FEM_FREQUENCY
    assert study.plain.rigid_frequency / printed.FREQUENCY == pytest.approx(1.336, abs=1e-3)
    assert study.shear.new.bearing_stiffness > 1.5 * study.plain.new.bearing_stiffness
    assert study.plain.at_speed == pytest.approx((printed.FREQUENCY, printed.FREQUENCY), rel=1e-9)
    assert study.shear.at_speed[0] < printed.FREQUENCY - 10
    assert study.stiffness.modal[1] / study.stiffness.modal[0] > 0.98
    assert study.lobes.pocket_limit_ratio(study.lobes.by_model) < 0.2
    assert study.lobes.errors_of_one_mode(study.lobes.one_mode, study.lobes.six_modes)[2] > 0.1


def test_least_squares_beats_picking_on_emulated_taps(study: PaperStudy) -> None:
    for picked, fitted in zip(study.tap.scatter_picked, study.tap.scatter_fitted, strict=True):
        assert 0.004 < picked < 0.04
        assert fitted < picked / 10


def test_the_emulated_tap_is_one_of_the_surrogate(study: PaperStudy) -> None:
    near = study.tap.tapped.in_band((1500.0, 1950.0))
    exact = sum(mode.receptance(near.frequency) for mode in study.tap.surrogate_modes)
    assert np.max(np.abs(near.receptance - exact)) < 0.01 * np.max(np.abs(exact))
    assert study.tap.tapped.n_averages == 10


def test_pockets_go_with_the_frequency(study: PaperStudy) -> None:
    before, after = study.lobes.pocket
    assert after / before == pytest.approx(0.9, abs=1e-3)
    assert study.lobes.share(study.lobes.by_model) == pytest.approx(
        study.stiffness.modal[1] / study.stiffness.modal[0], rel=1e-5
    )
