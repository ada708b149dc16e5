"""Lattices of lines with a known speed: families, the speed by least squares, its error in closed form."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from lobewatch.cuts.chatter_detection.spectrum import SpectralPeaks
from lobewatch.cuts.chatter_detection.tooth_passing_comb import find_sideband_families, refine_speed

pytestmark = pytest.mark.quick

TURN, CHATTER, BIN = 201.2837, 1712.3, 0.8
MULTIPLES = (4, 8, 12, 16)
ABOVE, BELOW = (0, 4, 8), (12, 16, 20)
"""Orders k of the lines f_c + k f and k f - f_c."""
ERROR = BIN * np.hypot(0.3 / np.sqrt(400.0), 0.03)
"""Standard error of each of the lines here (Hz): 0.3 bins over the root of the clearness, and 0.03 bins."""


def lines(frequencies: Sequence[float], loudest: float | None = None) -> SpectralPeaks:
    """Lines of one clearness; loudest: the frequency that is a little clearer than the others."""
    frequency = np.array(frequencies)
    clearness = np.where(frequency == loudest, 400.0 * (1 + 1e-9), 400.0)
    return SpectralPeaks(frequency, np.ones(frequency.size), clearness)


def comb() -> list[float]:
    return [k * TURN for k in MULTIPLES]


def family() -> list[float]:
    return [*(CHATTER + k * TURN for k in ABOVE), *(k * TURN - CHATTER for k in BELOW)]


def test_chatter_is_one_family_on_both_sides_of_the_multiples() -> None:
    multiples, chatter = find_sideband_families(TURN, lines(comb() + family(), CHATTER), 0.5 * BIN)
    assert multiples.indices.tolist() == [0, 1, 2, 3]
    assert multiples.sign.tolist() == [0, 0, 0, 0]
    assert multiples.order.tolist() == list(MULTIPLES)
    assert chatter.indices.tolist() == [4, 5, 6, 7, 8, 9]
    assert chatter.sign.tolist() == [1, 1, 1, -1, -1, -1]
    assert chatter.order.tolist() == [*ABOVE, *BELOW]


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize("place", range(10))
def test_a_line_belongs_to_a_lattice_within_the_tolerance_on_either_side(side: int, place: int) -> None:
    for share, count in ((0.98, 10), (1.02, 9)):
        frequencies = comb() + family()
        frequencies[place] += side * share * 0.5
        anchor = frequencies[4] if place != 4 else frequencies[5]
        families = find_sideband_families(TURN, lines(frequencies, anchor), 0.5)
        assert sum(part.indices.size for part in families) == count


def test_two_chatter_frequencies_are_two_families_and_a_line_alone_is_none() -> None:
    second = [1802.1, 1802.1 + 4 * TURN]
    families = find_sideband_families(TURN, lines([*comb(), *family(), *second, 950.0], CHATTER), 0.5 * BIN)
    assert [part.indices.tolist() for part in families] == [[0, 1, 2, 3], [4, 5, 6, 7, 8, 9], [10, 11]]
    many = [1300.0 + 17.3 * number + turns * TURN for number in range(5) for turns in (0, 4)]
    assert len(find_sideband_families(TURN, lines([*comb(), *many]), 0.5 * BIN)) == 1 + 4
    clearest = find_sideband_families(TURN, lines([*comb(), *family(), *second, 950.0], 1802.1), 0.5 * BIN)
    assert [part.indices.tolist() for part in clearest] == [[0, 1, 2, 3], [10, 11], [4, 5, 6, 7, 8, 9]]


@pytest.mark.parametrize("off", [-2e-4, 2e-4])
def test_the_speed_of_a_lattice_is_exact_whatever_it_was_taken_for(off: float) -> None:
    speed = refine_speed(TURN * (1 + off), lines(comb() + family(), CHATTER), BIN)
    assert speed.frequency == pytest.approx(TURN, rel=1e-12)
    assert (speed.share, speed.agreeing) == (1.0, 8)
    assert speed.misfit == pytest.approx(0.0, abs=1e-12)


def test_the_error_of_a_speed_from_multiples_follows_in_closed_form() -> None:
    """Sigma / sqrt(sum k^2) of f = sum k f_k / sum k^2."""
    speed = refine_speed(TURN, lines(comb()), BIN)
    assert speed.error == pytest.approx(ERROR / np.sqrt(sum(k**2 for k in MULTIPLES)), rel=1e-9)


def test_the_error_of_a_speed_from_chatter_alone_follows_in_closed_form() -> None:
    """A straight line through s f_i = f_c + s k f: the variance of its slope is sigma^2 / (sum k^2 - (sum s k)^2/n)."""
    speed = refine_speed(TURN, lines(family(), CHATTER), BIN)
    orders = [*ABOVE, *BELOW]
    signed = sum(ABOVE) - sum(BELOW)
    spread = sum(k**2 for k in orders) - signed**2 / len(orders)
    assert speed.frequency == pytest.approx(TURN, rel=1e-12)
    assert speed.error == pytest.approx(ERROR / np.sqrt(spread), rel=1e-9)


def test_the_misfit_is_the_mean_square_in_standard_errors_and_of_a_stray_line_that_of_its_limit() -> None:
    """Lines 1 and 2 f, each off by a standard error so that the slope is unmoved: 2 f low, f high by twice that."""
    off = [TURN + 2 * ERROR, 2 * TURN - ERROR, 3 * TURN]
    speed = refine_speed(TURN, lines(off), BIN)
    assert speed.frequency == pytest.approx(TURN, rel=1e-12)
    assert speed.misfit == pytest.approx((2**2 + 1**2 + 0) / 3, rel=1e-6)
    stray = refine_speed(TURN, lines([*off, 950.0]), BIN)
    assert stray.misfit == pytest.approx((2**2 + 1**2 + 10**2) / 4, rel=1e-6)
    assert (stray.share, stray.agreeing) == (0.75, 2)


@pytest.mark.parametrize(("bins", "is_taken"), [(1.15, True), (1.25, False)])
def test_a_speed_by_votes_may_be_off_by_1_2_bins_at_the_highest_multiple(bins: float, is_taken: bool) -> None:
    speed = refine_speed(TURN + bins * BIN / 16, lines([16 * TURN]), BIN)
    assert (speed.frequency == pytest.approx(TURN, rel=1e-12)) is is_taken


@pytest.mark.parametrize(("bins", "is_taken"), [(0.55, True), (0.65, False)])
def test_a_line_belongs_to_the_exact_lattice_within_0_6_bins(bins: float, is_taken: bool) -> None:
    exact = lines([*comb(), 20 * TURN + bins * BIN])
    sharp = SpectralPeaks(exact.frequency, exact.amplitude, np.array([1e8, 1e8, 1e8, 1e8, 1e-4]))
    assert refine_speed(TURN, sharp, BIN).share == (1.0 if is_taken else 0.8)


def test_where_lines_say_nothing_or_pull_too_far_the_speed_stays_what_it_was() -> None:
    """A single chatter line does not determine the speed; 0.5 % is too far."""
    nothing = refine_speed(TURN, lines([CHATTER]), BIN)
    assert (nothing.frequency, nothing.error, nothing.share, nothing.agreeing) == (TURN, np.inf, 0.0, 0)
    assert nothing.misfit == 10**2
    for off, kept in ((0.0046, False), (0.0054, True)):
        slow = refine_speed(TURN, lines([TURN * (1 + off)]), TURN * 0.01)
        assert (slow.frequency == TURN) is kept
