"""Properties of every spindle, on random ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from dsm import (
    Bearing,
    Segment,
    Spindle,
    calibrate,
    mode_shapes,
    modes_at,
    natural_frequencies,
    receptance,
    static_stiffness,
    stiffness_curve,
)


@st.composite
def segments(draw: st.DrawFn) -> Segment:
    outer = draw(st.floats(0.03, 0.12))
    return Segment(draw(st.floats(0.04, 0.2)), outer, outer * draw(st.floats(0.0, 0.7)))


@st.composite
def spindles(draw: st.DrawFn) -> Spindle:
    parts = draw(st.lists(segments(), min_size=1, max_size=5))
    ends = np.cumsum([0.0, *(part.length for part in parts)])
    choice = [*ends, *((ends[1:] + ends[:-1]) / 2)]
    places = draw(st.lists(st.sampled_from(choice), min_size=2, max_size=4, unique=True))
    exponents = draw(st.lists(st.floats(7.5, 9.5), min_size=len(places), max_size=len(places)))
    bearings = [Bearing(float(place), 10**power) for place, power in zip(places, exponents, strict=True)]
    return Spindle(parts, bearings)


def stiffened(spindle: Spindle, factor: float) -> Spindle:
    return replace(spindle, bearings=[replace(b, stiffness=factor * b.stiffness) for b in spindle.bearings])


def reversed_ends(spindle: Spindle) -> Spindle:
    bearings = [Bearing(spindle.length - b.position, b.stiffness) for b in spindle.bearings]
    return replace(spindle, segments=spindle.segments[::-1], bearings=bearings)


RANDOM = settings(max_examples=40, deadline=None)


@RANDOM
@given(spindles())
def test_frequencies_rise_with_bearing_stiffness_up_to_the_rigid_limit(spindle: Spindle) -> None:
    soft, stiff = natural_frequencies(spindle, 4), natural_frequencies(stiffened(spindle, 2.0), 4)
    rigid = natural_frequencies(spindle, 4, rigid_bearings=True)
    slack = 1 + 1e-7
    assert np.all(soft <= stiff * slack)
    assert np.all(stiff <= rigid * slack)
    assert np.any(soft < 0.9999 * stiff)
    assert np.all(stiff / soft <= np.sqrt(2) * slack)


@RANDOM
@given(spindles(), st.integers(1, 3))
def test_calibration_inverts_natural_frequencies_of_random_spindles(spindle: Spindle, mode: int) -> None:
    frequency = float(natural_frequencies(spindle, mode)[-1])
    found = calibrate(stiffened(spindle, 0.1), frequency, frequency_std=1e-3 * frequency, mode=mode)
    assume(found.sensitivity > 0.01)
    assert found.factor == pytest.approx(10.0, rel=1e-7)
    assert found.residual / frequency == pytest.approx(0, abs=1e-8)
    assert found.bearing_stiffness == pytest.approx(np.mean([b.stiffness for b in spindle.bearings]), rel=1e-7)
    assert found.bearing_stiffness_std == pytest.approx(1e-3 * found.bearing_stiffness / found.sensitivity)
    curve = stiffness_curve(spindle, [frequency], mode)
    assert curve[0] == pytest.approx(found.bearing_stiffness, rel=1e-7)


@RANDOM
@given(spindles(), st.integers(1, 3))
def test_sensitivity_is_the_slope_of_the_frequency(spindle: Spindle, mode: int) -> None:
    step = 1e-3
    low, middle, high = (float(natural_frequencies(stiffened(spindle, np.exp(d)), mode)[-1]) for d in (-step, 0, step))
    gap = np.min(np.abs(np.diff(natural_frequencies(spindle, mode + 1)))) / middle
    assume(gap > 0.05)
    found = calibrate(spindle, middle, mode=mode)
    assert 0 <= 2 * found.sensitivity <= 1
    assert found.sensitivity == pytest.approx(np.log(high / low) / (2 * step), rel=1e-3, abs=1e-6)


@RANDOM
@given(spindles(), st.integers(0, 3))
def test_the_other_way_round_it_is_the_same_spindle(spindle: Spindle, choice: int) -> None:
    place = (0.0, spindle.length, *(bearing.position for bearing in spindle.bearings))[choice]
    mirrored = reversed_ends(spindle)
    frequency = np.linspace(1.0, 5000.0, 20)
    forward = receptance(spindle, frequency, place, loss_factor=0.05)
    backward = receptance(mirrored, frequency, spindle.length - place, loss_factor=0.05)
    assert np.abs(forward - backward) == pytest.approx(0, abs=1e-7 * float(np.max(np.abs(forward))))
    assert natural_frequencies(spindle, 3) == pytest.approx(natural_frequencies(mirrored, 3), rel=1e-7)


@RANDOM
@given(spindles())
def test_a_segment_cut_in_two_changes_nothing(spindle: Spindle) -> None:
    halves = [replace(segment, length=segment.length / 2) for segment in spindle.segments for _ in range(2)]
    cut = replace(spindle, segments=halves)
    assert natural_frequencies(cut, 4) == pytest.approx(natural_frequencies(spindle, 4), rel=1e-7)
    assert static_stiffness(cut) == pytest.approx(static_stiffness(spindle), rel=1e-7)


@RANDOM
@given(spindles(), st.floats(0.1, 10.0))
def test_a_scaled_model(spindle: Spindle, scale: float) -> None:
    """All lengths times s, with E and rho kept: spring stiffness and static stiffness go as s, frequencies as 1/s."""
    parts = [Segment(s.length * scale, s.outer_diameter * scale, s.bore_diameter * scale) for s in spindle.segments]
    bearings = [Bearing(b.position * scale, b.stiffness * scale) for b in spindle.bearings]
    scaled = replace(spindle, segments=parts, bearings=bearings)
    assert natural_frequencies(scaled, 3) * scale == pytest.approx(natural_frequencies(spindle, 3), rel=1e-7)
    assert static_stiffness(scaled) / scale == pytest.approx(static_stiffness(spindle), rel=1e-7)


@RANDOM
@given(spindles())
def test_static_stiffness_is_the_receptance_at_rest(spindle: Spindle) -> None:
    assert 1 / receptance(spindle, [0.0])[0].real == pytest.approx(static_stiffness(spindle), rel=1e-7)


@RANDOM
@given(spindles())
def test_shapes_and_modal_stiffness_agree(spindle: Spindle) -> None:
    modes = mode_shapes(spindle, 3)
    frequency, stiffness = modes_at(spindle, 3)
    assert modes.deflection.shape == modes.slope.shape == (3, modes.position.size)
    assert modes.frequency == pytest.approx(frequency, rel=1e-7)
    expected = (2 * np.pi * frequency / modes.deflection[:, 0]) ** 2
    flexible = stiffness < 1e12
    assert stiffness[flexible] == pytest.approx(expected[flexible], rel=1e-4)
