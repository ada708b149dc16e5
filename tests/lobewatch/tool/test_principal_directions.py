"""Principal directions of modes from taps in x, in y and cross taps."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from lobes import project_modes
from lobewatch.tool.principal_directions import HIDDEN_PEAK_RATIO, find_principal_directions
from modal import Mode

pytestmark = pytest.mark.quick

PAIR = [Mode(1500.0, 0.03, 20e6), Mode(1575.0, 0.028, 22e6)]


def turned_by(degrees: float) -> NDArray[np.float64]:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, s], [-s, c]])


def residues(vectors: NDArray[np.float64], modes: list[Mode], near: float) -> NDArray[np.float64]:
    """Residues in xx, xy, yx and yy (2, 2) of the modes near a frequency (Hz)."""
    chosen = [(u, mode) for u, mode in zip(vectors, modes, strict=True) if abs(mode.frequency / near - 1) < 0.01]
    return np.asarray(sum(np.outer(u, u) / mode.stiffness for u, mode in chosen))


@pytest.mark.parametrize("angle", [10.0, 45.0, -70.0])
def test_two_peaks_in_both_are_two_rotated_modes_and_one_sign_is_open(angle: float) -> None:
    vectors = turned_by(angle)
    shown = project_modes(PAIR, vectors)
    axes = find_principal_directions(shown.x, shown.y)
    assert (len(axes.pairs), axes.sign_count, axes.are_uncertain) == (2, 1, True)
    modes = [*shown.x, *shown.y]
    errors = []
    for pattern in axes.sign_patterns:
        assert pattern is not None
        at = [residues(pattern, modes, mode.frequency) for mode in PAIR]
        true = [np.outer(u, u) / mode.stiffness for u, mode in zip(vectors, PAIR, strict=True)]
        assert [np.diag(r) for r in at] == [pytest.approx(np.diag(r)) for r in true]
        errors.append(np.max(np.abs(np.array(at) - true) / np.max(true)))
    assert min(errors) < 1e-6
    assert max(errors) > 0.1


@pytest.mark.parametrize("angle", [10.0, 45.0, -70.0])
def test_a_cross_tap_says_to_which_side(angle: float) -> None:
    shown = project_modes(PAIR, turned_by(angle))
    axes = find_principal_directions(shown.x, shown.y, shown.cross)
    assert not axes.are_uncertain
    (pattern,) = axes.sign_patterns
    assert pattern is not None
    for u, mode in zip(turned_by(angle), PAIR, strict=True):
        wanted = np.outer(u, u) / mode.stiffness
        found = residues(pattern, [*shown.x, *shown.y], mode.frequency)
        assert found == pytest.approx(wanted, abs=1e-4 / mode.stiffness)


def test_a_cross_tap_that_shows_nothing_leaves_modes_along_x_and_y() -> None:
    shown = project_modes(PAIR, turned_by(45))
    assert find_principal_directions(shown.x, shown.y, []).sign_patterns == [None]


def test_one_peak_in_each_at_one_frequency_is_a_round_spindle_turned_by_any_angle() -> None:
    axes = find_principal_directions([PAIR[0]], [PAIR[0].scaled(1.001, 1.1, "")])
    assert axes.sign_patterns == [None]
    assert axes.pairs[0].max_rotation == pytest.approx(np.pi / 2)
    vectors = axes.sample(500, 3)
    stiffness = np.array([20e6, 22e6])
    shown = np.einsum("cna,cnb,n->cab", vectors, vectors, 1 / stiffness)
    assert shown == pytest.approx(np.broadcast_to(np.diag(1 / stiffness), shown.shape), abs=1e-16)
    assert np.ptp(np.arctan2(vectors[:, 0, 1], vectors[:, 0, 0])) > 3


def test_peaks_apart_are_turned_as_far_as_the_other_tap_would_not_have_shown() -> None:
    axes = find_principal_directions(PAIR[:1], PAIR[1:])
    share = axes.sample(2000, 1)[:, 0, 1] ** 2 / PAIR[0].stiffness * PAIR[1].stiffness
    assert np.max(share) == pytest.approx(HIDDEN_PEAK_RATIO, rel=0.05)


def test_a_mode_of_one_direction_alone_leans_by_what_is_hidden() -> None:
    axes = find_principal_directions([PAIR[0], Mode(3000.0, 0.02, 60e6)], [PAIR[0].scaled(1.001, 1.0, "")])
    assert axes.max_cross_share == pytest.approx([0, np.sqrt(3 * HIDDEN_PEAK_RATIO), 0])
    assert np.all(np.abs(axes.sample(100, 0)[:, 1, 1]) <= np.sqrt(3 * HIDDEN_PEAK_RATIO))


def test_two_families_of_modes_far_apart_are_two_round_pairs() -> None:
    x = [PAIR[0], Mode(2400.0, 0.02, 25e6)]
    axes = find_principal_directions(x, [mode.scaled(1.002, 1.05, "") for mode in x])
    assert axes.sign_count == 0
    assert axes.sign_patterns == [None]


def test_a_small_mode_next_to_a_large_one_makes_no_rotated_pair() -> None:
    x = [PAIR[0], Mode(1650.0, 0.02, 250e6)]
    assert find_principal_directions(x, [mode.scaled(1.002, 1.05, "") for mode in x]).sign_count == 0


def test_x_and_y_of_one_mode_3_percent_apart_still_belong_together() -> None:
    shown = project_modes(PAIR, turned_by(30))
    moved = [mode.scaled(1.03, 1.0, "") for mode in shown.y]
    axes = find_principal_directions(shown.x, moved)
    assert [(pair.x, pair.y) for pair in axes.pairs] == [(0, 2), (1, 3)]
    assert axes.sign_count == 1


def test_frfs_that_tell_x_from_y_leave_no_sign_and_little_rotation() -> None:
    """Residues of the modes of x in y, and of y in x, in parts of those that are there."""
    shown = project_modes(PAIR, turned_by(30))
    y = [mode.scaled(1.03, 1.0, "") for mode in shown.y]
    residue = np.array([1 / mode.stiffness for mode in (*y, *shown.x)])
    apart = find_principal_directions(shown.x, y, hidden=0.01 * residue)
    assert apart.sign_count == 0
    assert [pair.max_rotation for pair in apart.pairs] == pytest.approx(2 * [np.arcsin(0.1)])
    assert find_principal_directions(shown.x, y, hidden=0.9 * residue).sign_count == 1
    assert find_principal_directions(shown.x, y, hidden=np.full(4, np.inf)).sign_count == 1


def test_a_mode_of_one_direction_leans_no_more_than_the_other_frf_allows() -> None:
    hidden = np.array([np.inf, 1e-4 / 60e6, np.inf])
    axes = find_principal_directions(
        [PAIR[0], Mode(3000.0, 0.02, 60e6)], [PAIR[0].scaled(1.001, 1.0, "")], None, hidden
    )
    assert axes.max_cross_share == pytest.approx([0, 0.01, 0])


def test_modes_of_open_signs_may_also_be_along_x_and_y() -> None:
    shown = project_modes(PAIR, turned_by(30))
    axes = find_principal_directions(shown.x, shown.y)
    along = axes.possible_vectors[-1]
    assert len(axes.possible_vectors) == 3
    assert along.tolist() == [[1, 0], [1, 0], [0, 1], [0, 1]]
    vectors = axes.sample(300, 0)
    assert {np.sign(np.round(v[0, 1], 9)) for v in vectors} == {-1.0, 0.0, 1.0}
    assert len(find_principal_directions(shown.x, shown.y, shown.cross).possible_vectors) == 1
