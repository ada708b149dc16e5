"""Verdicts on half-sine pulses as other hammers, conditioners and recorders give them: long, high-passed, coarse."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from acquisition import Channel, Hit, HitFlags, HitVerdict, check_hit, evaluate_hit

RATE = 51200.0
BEFORE = 1000


def half_sine(time: NDArray[np.float64], peak: float, start: float, width: float) -> NDArray[np.float64]:
    inside = (time > start) & (time < start + width)
    return np.where(inside, peak * np.sin(np.pi * (time - start) / width), 0.0)


def hit(width: float, *, second: float = 0.0, high_pass: float = 0.0, before: int = BEFORE) -> Hit:
    """300 N on a 1 kHz mode; a second contact 5 widths later; a high-pass conditioner (Hz)."""
    time = (np.arange(12800) - before) / RATE
    random = np.random.default_rng(5).normal(size=(2, time.size))
    force = half_sine(time, 300, 0, width) + half_sine(time, second, 5 * width, width)
    if high_pass:
        pole = np.exp(-2 * np.pi * high_pass / RATE)
        force = lfilter([(1 + pole) / 2, -(1 + pole) / 2], [1, -pole], force)
    ringing = np.where(time > 0, 1000 * np.exp(-300 * time) * np.sin(2 * np.pi * 1000 * time), 0.0)
    return Hit(force + 0.02 * random[0], ringing + 0.1 * random[1], RATE, before)


def recorded(one: Hit, bits: int, force_range: float = 2200.0) -> Hit:
    """Return a hit as in a text or MAT file: in steps of the converter, but without its codes."""
    channels = (Channel("force", 1.0, force_range, bits), Channel("acceleration", 1.0, 2000.0, bits))
    codes = np.stack([c.encode(s) for c, s in zip(channels, (one.force, one.acceleration), strict=True)])
    return replace(Hit.from_codes(codes, channels, RATE, BEFORE), codes=None, channels=None)


@pytest.mark.parametrize(("width", "high_pass"), [(0.5e-3, 50.0), (2e-3, 16.0), (5e-3, 5.0)])
def test_a_force_that_sinks_below_zero_behind_a_high_pass_is_no_double_hit(width: float, high_pass: float) -> None:
    one = hit(width, high_pass=high_pass)
    assert np.min(one.force) < -0.05 * np.max(one.force)
    assert evaluate_hit(one) == HitVerdict(HitFlags.OK)
    assert evaluate_hit(hit(width, second=40.0, high_pass=high_pass)).notes
    assert check_hit(hit(width, second=300.0, high_pass=high_pass)) == HitFlags.DOUBLE_HIT


@pytest.mark.parametrize("bits", [12, 16])
@pytest.mark.parametrize("width", [0.5e-3, 2e-3, 5e-3])
def test_coarse_steps_of_a_recording_are_no_flat_top(bits: int, width: float) -> None:
    one = recorded(hit(width), bits)
    top = one.force == one.force.max()
    assert check_hit(one) == HitFlags.OK
    assert (bits, width) != (12, 5e-3) or np.count_nonzero(top) > 10


@pytest.mark.parametrize("bits", [12, 16])
@pytest.mark.parametrize("force_range", [100.0, 295.0])
def test_a_rail_in_a_recording_is_inferred(bits: int, force_range: float) -> None:
    assert check_hit(recorded(hit(0.5e-3), bits, force_range)) == HitFlags.OVERLOAD_FORCE


@pytest.mark.parametrize("before", [0, 30, 100])
@pytest.mark.parametrize("width", [0.5e-3, 5e-3])
def test_where_the_pre_trigger_is_not_known_the_pulse_is_no_baseline(before: int, width: float) -> None:
    assert check_hit(replace(hit(width, before=before), pre_trigger=0)) == HitFlags.OK
