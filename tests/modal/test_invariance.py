"""Changes of input that leave modes unchanged or change them in proportion."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acquisition import Frf
from modal import Mode, fit_modes, pick_peaks, synthesize_frf

DAMPING = st.floats(0.002, 0.03)
SEPARATED = st.builds(
    lambda start, steps: start * np.cumprod([1.0, *steps]),
    st.floats(200, 500),
    st.lists(st.floats(1.6, 2.2), max_size=3),
)
MODES = SEPARATED.flatmap(
    lambda f: st.lists(
        st.tuples(DAMPING, st.floats(0.5, 2.0), st.sampled_from([1, -1])), min_size=len(f), max_size=len(f)
    ).map(
        lambda rest: [
            Mode(float(fn), z, sign * share * 0.05 / z * 1e7) for fn, (z, share, sign) in zip(f, rest, strict=True)
        ]
    )
)
LINES = np.arange(2.0, 8000.0, 2.0)


@settings(max_examples=40, deadline=None)
@given(MODES)
def test_round_trip(modes: list[Mode]) -> None:
    found = fit_modes(synthesize_frf(modes, LINES))
    assert len(found) == len(modes)
    for a, b in zip(found, modes, strict=True):
        assert a.frequency == pytest.approx(b.frequency, rel=1e-6)
        assert a.damping_ratio == pytest.approx(b.damping_ratio, rel=1e-4)
        assert a.stiffness == pytest.approx(b.stiffness, rel=1e-4)
        assert a.is_driving_point == b.is_driving_point


def noisy(seed: int) -> Frf:
    exact = synthesize_frf([Mode(700.0, 0.02, 5e7), Mode(1722.0, 0.03, -3.5e7)], LINES)
    noise = np.random.default_rng(seed).normal(size=(2, LINES.size)) * 1e-9
    return Frf(LINES, exact.receptance + noise[0] + 1j * noise[1])


@settings(max_examples=20, deadline=None)
@given(st.floats(-12, 12), st.floats(-3, 3))
def test_units_of_receptance_and_of_frequency(log_factor: float, log_stretch: float) -> None:
    factor, stretch = 10**log_factor, 10**log_stretch
    frf = noisy(0)
    scaled = Frf(frf.frequency * stretch, frf.receptance * factor)
    for method in (fit_modes, pick_peaks):
        for a, b in zip(method(scaled), method(frf), strict=True):
            assert a.frequency == pytest.approx(b.frequency * stretch, rel=1e-8)
            assert a.damping_ratio == pytest.approx(b.damping_ratio, rel=1e-6)
            assert a.stiffness == pytest.approx(b.stiffness / factor, rel=1e-6)
            if method is fit_modes:
                assert a.standard_error == pytest.approx(b.standard_error * [stretch, 1, 1 / factor], rel=1e-4)


@settings(max_examples=20, deadline=None)
@given(st.floats(-1e-7, 1e-7), st.floats(-1e-7, 1e-7), st.floats(-1e-2, 1e-2))
def test_what_modes_far_away_leave_does_not_matter(real: float, imaginary: float, far_below: float) -> None:
    modes = [Mode(700.0, 0.02, 5e7), Mode(1722.0, 0.03, 3.5e7)]
    extra = real + 1j * imaginary + far_below / LINES**2
    near = (LINES > 450) & (LINES < 4000)
    frf = Frf(LINES[near], (synthesize_frf(modes, LINES).receptance + extra)[near])
    found = {round(mode.frequency): mode for mode in fit_modes(frf)}
    for mode in modes:
        assert found[round(mode.frequency)].stiffness == pytest.approx(mode.stiffness, rel=1e-4)


@pytest.mark.parametrize("seed", range(5))
def test_sign_of_the_receptance_is_the_sign_of_the_stiffness(seed: int) -> None:
    frf = noisy(seed)
    for method in (fit_modes, pick_peaks):
        for a, b in zip(method(Frf(frf.frequency, -frf.receptance)), method(frf), strict=True):
            assert a.stiffness == pytest.approx(-b.stiffness, rel=1e-9)
            assert a.damping_ratio == pytest.approx(b.damping_ratio, rel=1e-9)


def test_synthesis_adds_the_modes() -> None:
    modes = [Mode(700.0, 0.02, 5e7), Mode(1722.0, 0.03, -3.5e7)]
    frf = synthesize_frf(modes, [0.0, 700.0, 1722.0])
    assert frf.receptance[0] == pytest.approx(1 / 5e7 - 1 / 3.5e7)
    assert frf.receptance[1] == pytest.approx(1 / (2j * 0.02 * 5e7) + modes[1].receptance(np.array([700.0]))[0])
    assert synthesize_frf([], LINES).receptance == pytest.approx(np.zeros(LINES.size))
