"""A wrong quantity or unit of an FRF is told from its modes."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations
from typing import get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acquisition import Frf
from acquisition.frf import FrfQuantity
from modal import Mode, Trust, assess_trust, fit_modes, select_credible_modes, synthesize_frf
from modal.modes.mistaken_quantity import find_true_quantity, median_modal_mass

SPINDLE = (Mode(700.0, 0.03, 4e7), Mode(1240.0, 0.02, 3e7), Mode(2300.0, 0.015, 9e7))
LINES = np.arange(2.0, 3500.0, 2.0)
ORDER = {quantity: order for order, quantity in enumerate(get_args(FrfQuantity))}


def mistaken(modes: tuple[Mode, ...], true: FrfQuantity, stated: FrfQuantity, noise: float = 0.01) -> Frf:
    """Return an FRF whose values are the true quantity, but count as the stated one."""
    random = np.random.default_rng(1).normal(size=(2, LINES.size))
    frf = synthesize_frf(list(modes), LINES)
    values = frf.receptance * (2j * np.pi * LINES) ** (ORDER[true] - ORDER[stated])
    return Frf(LINES, values * (1 + noise * (random[0] + 1j * random[1])), measured_as=stated)


def codes(modes: list[Mode]) -> set[str]:
    return {remark.code for mode in modes for remark in mode.remarks}


@pytest.mark.parametrize(("true", "stated"), [*permutations(get_args(FrfQuantity), 2)])
@pytest.mark.parametrize("opposed", [(), (1,)])
def test_each_wrong_quantity_is_told_at_driving_and_transfer_points(
    true: FrfQuantity, stated: FrfQuantity, opposed: tuple[int, ...]
) -> None:
    spindle = tuple(replace(m, stiffness=-m.stiffness) if i in opposed else m for i, m in enumerate(SPINDLE))
    modes = fit_modes(mistaken(spindle, true, stated))
    known = [mode for mode in modes if assess_trust(mode) is not Trust.REJECTED]
    assert find_true_quantity(known, stated) == true
    assert all("wrong-quantity" in codes([mode]) for mode in modes)
    assert not {"not-driving-point", "complex-mode"} & codes(modes)
    assert Trust.TRUSTED not in map(assess_trust, modes)


@pytest.mark.parametrize("quantity", get_args(FrfQuantity))
@pytest.mark.parametrize("opposed", [(), (1,), (0, 1, 2)])
def test_the_stated_quantity_is_not_questioned(quantity: FrfQuantity, opposed: tuple[int, ...]) -> None:
    spindle = tuple(replace(m, stiffness=-m.stiffness) if i in opposed else m for i, m in enumerate(SPINDLE))
    modes = fit_modes(mistaken(spindle, quantity, quantity))
    assert not {"wrong-quantity", "wrong-unit"} & codes(modes)
    assert all(assess_trust(mode) is Trust.TRUSTED for mode in modes)


def test_a_wrong_unit_is_told_by_the_modal_mass() -> None:
    frf = mistaken(SPINDLE, "receptance", "receptance")
    micrometres = fit_modes(replace(frf, receptance=1e6 * frf.receptance))
    assert "wrong-unit" in codes(micrometres)
    assert "wrong-quantity" not in codes(micrometres)
    assert {assess_trust(mode) for mode in micrometres} == {Trust.DOUBTFUL}


def test_a_stiffness_that_a_wrong_quantity_explains_gets_its_remedy() -> None:
    modes = fit_modes(mistaken(SPINDLE, "accelerance", "receptance"))
    remarks = select_credible_modes(modes).remarks
    (cure,) = {remark.cure for mode in modes for remark in mode.remarks if remark.code == "wrong-quantity"}
    assert {(remark.code, remark.cure) for remark in remarks} == {("stiffness-not-believed", cure)}


@settings(max_examples=50)
@given(
    frequency=st.floats(100.0, 5000.0),
    stiffness=st.floats(1e6, 1e9),
    pair=st.sampled_from([*permutations(get_args(FrfQuantity), 2)]),
)
def test_a_single_undamped_mode_is_enough(
    frequency: float, stiffness: float, pair: tuple[FrfQuantity, FrfQuantity]
) -> None:
    true, stated = pair
    constant = (2j * np.pi * frequency) ** (ORDER[true] - ORDER[stated]) / stiffness
    sign = 1.0 if constant.real > 0 or (constant.real == 0 and constant.imag > 0) else -1.0
    phase = float(np.degrees(np.angle(sign * constant)))
    read = Mode(frequency, 0.02, sign / abs(constant), phase_deg=phase)
    mass = median_modal_mass([Mode(frequency, 0.02, stiffness)])
    if 1e-2 < mass < 1e2:
        assert find_true_quantity([read], stated) == true
