"""The stabilisation chart and the choice of physical poles."""

from __future__ import annotations

import numpy as np
import pytest

from modal import Mode, fit_lscf_poles, select_physical_poles, synthesize_frf

MODES = [Mode(1500.0, 0.01, 4e7), Mode(1722.0, 0.03, -3.5e7), Mode(1900.0, 0.005, 9e7)]
LINES = np.linspace(1200.0, 2200.0, 801)
EQUAL = np.ones((1, LINES.size))


def test_poles_of_known_modes_are_exact_and_stable_from_their_order_on() -> None:
    chart = fit_lscf_poles(LINES, synthesize_frf(MODES, LINES).receptance[None], EQUAL, 10)
    poles = select_physical_poles(chart)
    near = [int(np.argmin(np.abs(poles.frequency - mode.frequency))) for mode in MODES]
    assert poles.frequency[near] == pytest.approx([m.frequency for m in MODES], rel=1e-7)
    assert poles.damping_ratio[near] == pytest.approx([m.damping_ratio for m in MODES], rel=1e-4)
    assert 1 / poles.flexibility[near, 0].real == pytest.approx([m.stiffness for m in MODES], rel=1e-2)
    assert np.all(np.abs(np.tan(np.angle(poles.flexibility[near, 0]))) < 0.02)
    assert np.all(poles.n_orders[near] >= 5)


def test_uneven_lines_give_the_same_poles() -> None:
    lines = np.sort(np.random.default_rng(0).uniform(1200.0, 2200.0, 700))
    poles = select_physical_poles(
        fit_lscf_poles(lines, synthesize_frf(MODES, lines).receptance[None], np.ones((1, lines.size)), 10)
    )
    for mode in MODES:
        assert np.min(np.abs(poles.frequency / mode.frequency - 1)) < 1e-7


def test_a_pole_is_stable_where_the_order_below_has_it() -> None:
    chart = fit_lscf_poles(LINES, synthesize_frf(MODES, LINES).receptance[None], EQUAL, 10)
    assert not np.any(chart.stable[chart.order == 1])
    for i in np.flatnonzero(chart.stable):
        before = chart.previous[i]
        assert chart.order[before] == chart.order[i] - 1
        distance = np.hypot(
            chart.frequency[i] - chart.frequency[before], np.diff(chart.damping_ratio[[before, i]])[0] * 1700
        )
        assert distance < 0.5 * chart.damping_ratio[i] * chart.frequency[i]


def test_noise_alone_has_no_physical_poles() -> None:
    random = np.random.default_rng(2)
    found = 0
    for _ in range(10):
        noise = random.normal(size=(1, LINES.size)) + 1j * random.normal(size=(1, LINES.size))
        found += select_physical_poles(fit_lscf_poles(LINES, noise, EQUAL, 10)).frequency.size
    assert found <= 2


@pytest.mark.quick
def test_poles_of_several_frfs_are_common() -> None:
    shapes = np.array([[1.0, 1.0, 1.0], [0.5, -0.8, 0.0]])
    curves = np.array([mode.receptance(LINES) for mode in MODES])
    poles = select_physical_poles(fit_lscf_poles(LINES, shapes @ curves, np.ones((2, LINES.size)), 10))
    near = [int(np.argmin(np.abs(poles.frequency - mode.frequency))) for mode in MODES]
    ratio = (poles.flexibility[near, 1] / poles.flexibility[near, 0]).real
    assert ratio == pytest.approx(shapes[1], abs=0.01)


@pytest.mark.quick
def test_few_lines_give_few_orders_and_none_at_all_an_empty_chart() -> None:
    chart = fit_lscf_poles(LINES[:7], synthesize_frf(MODES, LINES[:7]).receptance[None], EQUAL[:, :7], 10)
    assert np.max(chart.order, initial=0) <= 2
    empty = fit_lscf_poles(LINES[:3], synthesize_frf(MODES, LINES[:3]).receptance[None], EQUAL[:, :3], 10)
    assert empty.order.size == 0
    assert select_physical_poles(empty).frequency.size == 0
