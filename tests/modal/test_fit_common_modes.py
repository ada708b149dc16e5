"""Several FRFs with common poles, mode shapes, and the same mode in the next measurement."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition import Frf
from modal import Mode, fit_common_modes, fit_modes, follow_mode, mac, mode_indicator, synthesize_frf

LINES = np.arange(5.0, 4000.0, 5.0)
SHAPES = np.array([[1.0, 0.5, -0.7], [1.0, -0.8, 0.3], [0.6, 1.0, 0.9]])
MODES = [Mode(900.0, 0.02, 4e7), Mode(1722.0, 0.03, 3.5e7), Mode(1790.0, 0.03, 5e7)]


def points(
    noise: float = 0.0, seed: int = 0, shapes: NDArray[np.float64] = SHAPES, modes: Sequence[Mode] = MODES
) -> list[Frf]:
    """Driving point first: the flexibilities of a mode are shape_i shape_0 / K, K that of a shape of 1."""
    exact = sum(np.outer(shape * shape[0], mode.receptance(LINES)) for shape, mode in zip(shapes, modes, strict=True))
    random = np.random.default_rng(seed).normal(size=(2, *np.shape(exact)))
    return [Frf(LINES, row) for row in exact + noise * np.max(np.abs(exact)) * (random[0] + 1j * random[1])]


def test_poles_are_common_and_shapes_those_of_the_structure() -> None:
    found = fit_common_modes(points())
    assert len(found) == 3
    for mode, true, shape in zip(found, MODES, SHAPES, strict=True):
        assert mode.frequency == pytest.approx(true.frequency, rel=1e-6)
        assert mode.damping_ratio == pytest.approx(true.damping_ratio, rel=2e-4)
        assert mode.stiffness == pytest.approx(true.stiffness / shape[0] ** 2, rel=1e-3)
        assert mode.shape is not None
        assert mode.shape == pytest.approx(shape, abs=1e-3)
        assert mac(mode.shape, shape) > 0.99999


def test_errors_in_noise_are_those_that_are_stated() -> None:
    fits = [fit_common_modes(points(1e-3, seed)) for seed in range(20)]
    for i, (true, shape) in enumerate(zip(MODES, SHAPES, strict=True)):
        error = np.array([fit[i].stiffness for fit in fits]) - true.stiffness / shape[0] ** 2
        stated = np.sqrt(np.mean([fit[i].standard_error[2] ** 2 for fit in fits]))
        assert np.sqrt(np.mean(error**2)) == pytest.approx(stated, rel=0.5)


def test_the_first_point_of_a_shape_is_positive_whatever_the_sign_of_the_response() -> None:
    turned = [Frf(LINES, -frf.receptance) for frf in points()]
    for mode, shape in zip(fit_common_modes(turned), SHAPES, strict=True):
        assert not mode.is_driving_point
        assert mode.shape is not None
        assert mode.shape == pytest.approx(shape, abs=1e-3)


def test_one_frf_is_allowed_and_different_lines_and_none_are_not() -> None:
    (one, *_) = points()
    assert [round(mode.frequency) for mode in fit_common_modes([one])] == [900, 1722, 1790]
    with pytest.raises(ValueError, match="no FRF"):
        fit_common_modes([])
    with pytest.raises(ValueError, match="frequency lines"):
        fit_common_modes([one, Frf(LINES[1:], one.receptance[1:])])


@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_of_one_frf_it_is_the_same_as_fit_modes(noise: float) -> None:
    (one, *_) = points(noise)
    found, wanted = fit_common_modes([one]), fit_modes(one)
    assert len(wanted) == 3
    for mode, other in zip(found, wanted, strict=True):
        for name, value in vars(other).items():
            assert np.array_equal(getattr(mode, name), value), name


def test_a_mode_without_a_peak_of_its_own_is_found() -> None:
    """All points move alike, a third of a half-power width apart: no FRF shows two peaks."""
    pair = [Mode(1722.0, 0.03, 3.5e7), Mode(1757.0, 0.03, 5e7)]
    for seed in range(5):
        found = fit_common_modes(points(4e-4, seed, np.ones((2, 3)), pair))
        assert len(found) == 2
        for mode, true in zip(found, pair, strict=True):
            assert abs(mode.frequency - true.frequency) < 4 * mode.standard_error[0]
            assert abs(mode.stiffness - true.stiffness) < 4 * mode.standard_error[2]
            assert mode.shape == pytest.approx([1, 1, 1], abs=0.1)
            assert [remark.code for remark in mode.remarks] == ["overlaps"]


def test_a_weak_mode_on_the_flank_of_a_strong_one_is_found() -> None:
    pair = [Mode(1500.0, 0.03, 3e7), Mode(1900.0, 0.03, 1.5e9)]
    for seed in range(5):
        found = fit_common_modes(points(1e-3, seed, SHAPES[:2], pair))
        assert [mode.frequency for mode in found] == pytest.approx([1500.0, 1900.0], rel=5e-3)


def test_a_stray_line_in_one_of_the_frfs_is_left_out() -> None:
    clean = points(1e-3, 0, SHAPES[:1], MODES[:1])
    hum = np.where(LINES == 905.0, 0.2 * np.max(np.abs(clean[0].receptance)), 0.0)
    with_hum = [clean[0], replace(clean[1], receptance=clean[1].receptance + hum), clean[2]]
    (found,), (without,) = fit_common_modes(with_hum), fit_common_modes(clean)
    assert found.standard_error == pytest.approx(without.standard_error, rel=0.3)
    assert abs(found.frequency - without.frequency) < without.standard_error[0]


def test_what_speaks_against_a_mode_is_reported() -> None:
    clean = points(1e-3, 0, SHAPES[:1], MODES[:1])
    (mode,) = fit_common_modes(clean)
    assert mode.remarks == ()
    assert mode.misfit == pytest.approx(1.0, abs=0.25)
    (cut,) = fit_common_modes(clean, (300.0, 915.0))
    assert [(remark.code, remark.about) for remark in cut.remarks] == [("cut-by-edge", f"{cut.frequency:.0f} Hz")]


def test_a_driving_point_near_a_node_is_reported() -> None:
    still = np.array([SHAPES[0], [0.004, 1.0, -1.0]])
    modes = [MODES[0], Mode(2600.0, 0.03, 2e5)]
    sure, unsure = fit_common_modes(points(5e-3, 0, still, modes))
    assert sure.remarks == ()
    assert [remark.code for remark in unsure.remarks] == ["near-node"]
    assert unsure.frequency == pytest.approx(2600.0, rel=1e-3)


def test_usable_band_is_the_narrowest() -> None:
    frfs = points()
    frfs[1] = replace(frfs[1], usable_band=(5.0, 1300.0))
    assert [round(mode.frequency) for mode in fit_common_modes(frfs)] == [900]


def test_mac_of_textbook_shapes() -> None:
    assert mac([1, 2, 3], [2, 4, 6]) == pytest.approx(1.0)
    assert mac([1, 0], [0, 1]) == 0
    assert mac([1, 1], [1, 0]) == pytest.approx(0.5)
    assert mac([1, 1j], [1j, -1]) == pytest.approx(1.0)
    with pytest.raises(ValueError, match="points"):
        mac([1, 2], [1, 2, 3])
    with pytest.raises(ValueError, match="zero"):
        mac([0, 0], [1, 2])


def test_mode_indicator_is_one_at_a_real_mode_alone_and_what_it_is_elsewhere() -> None:
    mode = Mode(1000.0, 0.02, 3e7)
    frf = synthesize_frf([mode], [500.0, 1000.0, 1010.0, 2000.0])
    phase = np.angle(frf.receptance)
    assert mode_indicator([frf]) == pytest.approx(1 - np.abs(np.cos(phase)))
    assert mode_indicator([frf, frf])[1] == pytest.approx(1.0)
    assert mode_indicator([frf])[3] < 0.01
    assert mode_indicator([Frf(LINES, np.zeros(LINES.size, complex))]) == pytest.approx(np.zeros(LINES.size))
    peaks = [float(mode_indicator(points())[np.argmin(np.abs(LINES - f))]) for f in (900.0, 1300.0)]
    assert peaks[0] > 0.9
    assert peaks[1] < 0.3
    with pytest.raises(ValueError, match="no FRF"):
        mode_indicator([])
    with pytest.raises(ValueError, match="frequency lines"):
        mode_indicator([frf, *points()])


LAST = Mode(1700.0, 0.03, 3.5e7)
NEIGHBOUR = Mode(1850.0, 0.03, 3.3e7)


def test_a_slow_change_is_followed_past_a_stronger_neighbour() -> None:
    for month in range(24):
        aged = Mode(1700.0 * 0.996 ** (month + 1), 0.03, 3.5e7)
        found = follow_mode(Mode(1700.0 * 0.996**month, 0.03, 3.5e7), [aged, NEIGHBOUR])
        assert found.mode is aged
        assert not found.remarks


def test_the_neighbour_in_place_of_a_mode_that_was_not_found_is_reported() -> None:
    found = follow_mode(LAST, [NEIGHBOUR])
    assert found.mode is NEIGHBOUR
    assert [(remark.code, remark.about) for remark in found.remarks] == [("large-change", "1850 Hz")]


def test_two_that_are_equally_like_it_are_reported() -> None:
    found = follow_mode(LAST, [Mode(1660.0, 0.03, 3.5e7), Mode(1745.0, 0.03, 3.5e7)])
    (remark,) = found.remarks
    assert found.mode is not None
    assert (remark.code, remark.about) == ("rival-mode", f"{found.mode.frequency:.0f} Hz")
    assert ("1745.0" if found.mode.frequency < 1700 else "1660.0") in remark.text


def test_the_shape_decides_between_two() -> None:
    first, second = (
        replace(LAST, frequency=f, shape=np.array(shape)) for f, shape in ((1690, [1, 0.9]), (1712, [1, -0.9]))
    )
    found = follow_mode(replace(LAST, shape=np.array([1.0, -1.0])), [first, second])
    assert found.mode is second


def test_nothing_near_is_no_mode() -> None:
    assert follow_mode(LAST, []).mode is None
    far = follow_mode(LAST, [Mode(2600.0, 0.03, 3.5e7)])
    assert far.mode is None
    assert [(remark.code, remark.about) for remark in far.remarks] == [("no-mode-to-follow", "1700 Hz")]
    assert "2600.0 Hz" in far.remarks[0].text
    assert follow_mode(LAST, [replace(LAST, stiffness=-3.5e7)]).mode is None


@pytest.mark.parametrize("gain", [0.01, 0.1, 10.0])
def test_a_mode_is_the_same_at_another_gain_if_its_frequency_and_damping_are(gain: float) -> None:
    same = Mode(1701.0, 0.029, 3.5e7 * gain)
    found = follow_mode(LAST, [Mode(2300.0, 0.03, 3.3e7), same])
    assert found.mode is same
    assert [remark.code for remark in found.remarks] == ["large-change"]


@pytest.mark.parametrize("other", [Mode(1740.0, 0.03, 3.5e8), Mode(1701.0, 0.12, 3.5e8)])
def test_it_is_another_mode_if_frequency_or_damping_differ_too(other: Mode) -> None:
    assert follow_mode(LAST, [other]).mode is None
