"""Force window: all touches inside, their baseline subtracted, little noise."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from acquisition import Hit, Structure, estimate_frf, propagate_force_noise
from acquisition.hits.force_window import window_force

STRUCTURE = Structure(np.array([500.0, 900.0]), np.array([0.02, 0.03]), np.array([2e7, 8e7]))
BEFORE = 0.02
"""Time before the main pulse (s)."""
Touches = list[tuple[float, float]]
"""Delay (s) and height over the first pulse of each touch."""


def touched(rate: float, width: float, touches: Touches, seconds: float = 0.4) -> Hit:
    """200 N on the structure, with further touches, without noise."""
    time = np.arange(int(seconds * rate)) / rate - BEFORE
    force, response = np.zeros(time.size), np.zeros(time.size)
    for delay, share in [(0.0, 1.0), *touches]:
        t = time - delay
        force += np.where((t > 0) & (t < width), 200 * share * np.sin(np.pi * t / width) ** 4, 0.0)
        response += 200 * share * STRUCTURE.response(t, width)
    return Hit(force, response, rate, round(BEFORE * rate))


def with_force(hit: Hit, added: NDArray[np.float64]) -> Hit:
    return Hit(hit.force + added, hit.acceleration, hit.sample_rate, hit.pre_trigger)


def measure_share(hit: Hit, clean: Hit) -> float:
    """Return the largest error of the windowed force spectrum up to 1 kHz, as a share of its largest value."""
    part = window_force(hit)
    kept = np.zeros(hit.force.size)
    kept[part.samples] = part.force
    lines = slice(1, int(1000 * hit.force.size / hit.sample_rate))
    found, expected = (np.fft.rfft(force)[lines] for force in (kept, clean.force))
    return float(np.max(np.abs(found - expected)) / np.max(np.abs(expected)))


@pytest.mark.parametrize("touches", [[(3e-3, 0.02)], [(12e-3, 0.3)], [(2e-3, 0.5), (5e-3, 0.1), (9e-3, 0.03)]])
def test_h1_of_a_record_without_noise_is_exact(touches: Touches) -> None:
    hit, one = touched(25600.0, 1e-3, touches), touched(25600.0, 1e-3, [])
    found, expected = (estimate_frf([each]).in_band((100.0, 1000.0)).receptance for each in (hit, one))
    assert found == pytest.approx(expected, rel=1e-3)
    whole = (np.fft.rfft(hit.acceleration) / np.fft.rfft(hit.force))[1:]
    line = np.fft.rfftfreq(hit.force.size, 1 / 25600.0)[1:]
    inside = (line >= 100) & (line <= 1000)
    assert found == pytest.approx((whole / -((2 * np.pi * line) ** 2))[inside], rel=1e-6)


@settings(max_examples=60, deadline=None)
@given(
    rate=st.floats(10e3, 100e3),
    width=st.floats(0.5e-3, 1.5e-3),
    share=st.floats(0.01, 0.3),
    delay=st.floats(0.0, 20e-3),
    offset=st.floats(-50.0, 50.0),
    seed=st.integers(0, 1000),
)
def test_a_touch_of_1_to_30_percent_is_inside(
    rate: float, width: float, share: float, delay: float, offset: float, seed: int
) -> None:
    clean = touched(rate, width, [(max(delay, 1.2 * width), share)])
    noise = 0.02 * np.random.default_rng(seed).normal(size=clean.force.size)
    assert measure_share(with_force(clean, noise + offset), clean) < 0.003


@pytest.mark.parametrize("delay", [-10e-3, -4e-3])
def test_a_touch_before_the_hit_is_inside(delay: float) -> None:
    clean = touched(25600.0, 0.7e-3, [(delay, 0.2)])
    noise = 0.05 * np.random.default_rng(1).normal(size=clean.force.size)
    assert measure_share(with_force(clean, noise), clean) < 0.003


@pytest.mark.parametrize("corner", [0.5, 2.0, 5.0])
def test_behind_a_high_pass_the_force_is_that_before_it(corner: float) -> None:
    """In one pole of corner fc the force sinks by 2 pi fc times its impulse."""
    clean = touched(51200.0, 0.7e-3, [(4e-3, 0.1), (11e-3, 0.03)])
    pole = np.exp(-2 * np.pi * corner / 51200.0)
    lag = np.zeros(clean.force.size)
    for i, force in enumerate(clean.force[:-1]):
        lag[i + 1] = pole * lag[i] + (1 - pole) * force
    noise = 0.02 * np.random.default_rng(2).normal(size=lag.size)
    assert measure_share(with_force(clean, noise - lag), clean) < 0.006
    cut = Hit(np.where(np.abs(clean.time) < 3e-3, clean.force - lag, 0.0), clean.acceleration, 51200.0, 1024)
    assert measure_share(cut, clean) > 0.03


def test_without_touches_noise_outside_the_window_is_out() -> None:
    """Noise of 0.5 N rms: the window of one pulse width on either side and two tapers has 3 + 2 * 3/8 widths."""
    clean, random = touched(25600.0, 0.7e-3, []), np.random.default_rng(3)
    powers = []
    for _ in range(300):
        part = window_force(with_force(clean, 0.5 * random.normal(size=clean.force.size)))
        powers.append(np.sum((part.force - clean.force[part.samples] * part.window) ** 2))
    width = window_force(clean).pulse.width
    assert np.mean(powers) == pytest.approx(0.5**2 * (3 + 2 * 3 / 8) * width, rel=0.1)


def test_zeros_behind_a_recorder_s_own_window_make_no_touches() -> None:
    clean = touched(25600.0, 0.7e-3, [])
    noise = 0.5 * np.random.default_rng(4).normal(size=clean.force.size)
    noise[900:] = 0.0
    assert window_force(with_force(clean, noise)).touches == []


def test_noise_of_two_impulses() -> None:
    """Two impulses A and B samples apart: both windows count, over |A + B exp(-2 pi j f t)|^2.

    The window of A has squares that add up to 23: 18 samples of weight 1, 7 on either side of cos^2(pi k / 16).
    That of B has 7 samples more, because B was found in averages of 8 samples.
    """
    rate, lines = 10_000.0, np.array([50.0, 300.0, 550.0])
    force = 2.0 * np.tile([1.0, -1.0], 1000)
    force[80:] = 0.0
    force[[100, 400]] = 100.0, 60.0
    (columns,) = propagate_force_noise([Hit(force, force, rate, 100)], lines)
    spectrum = 100 + 60 * np.exp(-2j * np.pi * lines * 300 / rate)
    found = np.sum(np.abs(columns[:, :-1]) ** 2, axis=1)
    assert found == pytest.approx((23 + 30) * 2.0**2 / np.abs(spectrum) ** 2)
