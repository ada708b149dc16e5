"""Signal at the spindle housing: transfer path, disturbances, aliasing."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition.emulation import Housing, TipMotion, make_random_housing, sample_housing

RATE = 102400.0


def tone(frequency: float) -> TipMotion:
    """Return a tone of 1 m/s^2 along x, 0.5 s long, with silence around it."""
    time = np.arange(int(0.5 * RATE)) / RATE
    wave = np.sin(2 * np.pi * frequency * time) * np.interp(time, [0, 0.1, 0.4, 0.5], [0, 1, 1, 0])
    return TipMotion(RATE, np.stack([wave, np.zeros(time.size)]))


def amplitude(heard: NDArray[np.float64], frequency: float, sample_rate: float = 25600.0) -> float:
    """Return the amplitude of a line (m/s^2) from the middle part."""
    piece = heard[heard.size // 2 - 2048 : heard.size // 2 + 2048]
    time = np.arange(piece.size) / sample_rate
    window = np.hanning(piece.size)
    return float(2 * np.abs(np.sum(piece * window * np.exp(-2j * np.pi * frequency * time))) / np.sum(window))


def sound(motion: TipMotion, housing: Housing) -> NDArray[np.float64]:
    return sample_housing(motion, housing, 6000.0, 25600.0, np.random.default_rng(1))


def test_the_housing_hears_the_tip_through_its_gain() -> None:
    assert amplitude(sound(tone(1000.0), Housing((0.1, 0.5))), 1000.0) == pytest.approx(0.1, rel=0.02)


def test_a_mode_of_the_housing_is_louder_at_its_frequency() -> None:
    housing = Housing((0.1, 0.0), modes=((1000.0, 0.02, 0.4),))
    expected = 0.1 * abs(1 + 0.4 / 0.04j)
    assert amplitude(sound(tone(1000.0), housing), 1000.0) == pytest.approx(expected, rel=0.03)


def test_without_a_filter_what_is_above_half_the_rate_is_folded_below_it() -> None:
    heard = sound(tone(18000.0), Housing((0.1, 0.0)))
    above = 0.1 / np.sqrt(1 + 0.9**4)
    assert amplitude(heard, 25600.0 - 18000.0) == pytest.approx(above, rel=0.04)


def test_other_machines_and_the_spindle_sound_whether_it_cuts_or_not() -> None:
    still = TipMotion(RATE, np.zeros((2, int(0.5 * RATE))))
    heard = sound(still, Housing((0.1, 0.1), tones=((500.0, 2.0), (1500.0, 0.5)), unbalance=1.5, noise=0.2))
    assert [amplitude(heard, f) for f in (500.0, 1500.0, 100.0)] == pytest.approx([2.0, 0.5, 1.5], abs=0.05)
    assert amplitude(heard, 3000.0) < 0.05


def test_noise_has_the_rms_it_is_given() -> None:
    heard = sound(TipMotion(RATE, np.zeros((2, int(RATE)))), Housing((0.1, 0.1), noise=0.3))
    assert heard.size == 25600
    assert float(np.std(heard)) == pytest.approx(0.3, rel=0.02)


def test_random_housings_are_such_as_promised() -> None:
    housings = [make_random_housing(np.random.default_rng(seed), 6000.0) for seed in range(200)]
    assert all(0.01 <= min(one.gain) <= max(one.gain) <= 0.3 for one in housings)
    assert all(len(one.tones) == 3 and 2 <= len(one.modes) <= 3 for one in housings)
    assert make_random_housing(np.random.default_rng(3), 6000.0).modes == housings[3].modes
