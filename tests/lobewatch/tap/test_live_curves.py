"""Curves of the screen: force spectrum in dB below its largest value."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition import Hit
from acquisition.estimation.estimate_frf import RunningMean
from lobewatch.tap.live_curves import build_curves

RATE = 25600.0


def test_the_force_spectrum_of_a_half_sine_is_that_of_the_closed_form() -> None:
    """Compare with |cos(pi f T) / (1 - (2 f T)^2)| of the value at 0 Hz, from a table of transforms."""
    duration = 1.01e-3
    time = np.arange(4096) / RATE - 0.01
    force = np.where((time > 0) & (time < duration), 200 * np.sin(np.pi * time / duration), 0.0)
    acceleration = np.where(time > 0, np.exp(-30 * time) * np.sin(2 * np.pi * 900 * time), 0.0)
    plots = build_curves(Hit(force, acceleration, RATE), RunningMean())
    assert plots.force_spectrum is not None
    low = plots.frequency < 1.2 / duration
    turns = plots.frequency[low] * duration
    expected = 20 * np.log10(np.abs(np.cos(np.pi * turns) / (1 - (2 * turns) ** 2)))
    assert plots.force_spectrum[low] == pytest.approx(expected, abs=0.3)
    assert np.min(expected) < -15
    assert np.max(plots.force_spectrum) == 0
