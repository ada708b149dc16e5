"""Chatter that leaves the cut, other machines, and ripple, on synthetic lines."""

from __future__ import annotations

import numpy as np
import pytest

from lobewatch.cuts.chatter_detection.load_ripple import Ripple
from lobewatch.cuts.chatter_detection.peak_classification import (
    ChatterPeaks,
    find_loudest_family,
    has_other_spacing,
    has_own_comb,
    is_other_source,
)
from lobewatch.cuts.chatter_detection.spectrum import SpectralPeaks

pytestmark = pytest.mark.quick

TURN, TEETH, BIN, CHATTER = 251.7, 4, 0.5, 1155.6
TOOTH = TEETH * TURN


def lines(*frequency: float) -> SpectralPeaks:
    return SpectralPeaks(np.array(frequency), np.ones(len(frequency)), np.full(len(frequency), 1e4))


def chatter_of(left: SpectralPeaks) -> ChatterPeaks:
    return find_loudest_family(left, TOOTH, BIN)


def test_harmonics_with_side_bands_one_tooth_passing_away_are_those_of_chatter() -> None:
    harmonics = [k * CHATTER for k in range(1, 8)]
    other, own = lines(*harmonics), lines(*harmonics, *(k * CHATTER + TOOTH for k in range(1, 4)), CHATTER - TOOTH,
                                          2 * CHATTER - TOOTH, 3 * CHATTER - TOOTH, CHATTER + 2 * TOOTH)  # fmt: skip
    assert has_own_comb(other, chatter_of(other), TOOTH, BIN)
    assert is_other_source(other, chatter_of(other), TURN, TEETH, BIN, is_faint=False)
    assert not has_own_comb(own, chatter_of(own), TOOTH, BIN)
    assert not is_other_source(own, chatter_of(own), TURN, TEETH, BIN, is_faint=False)


@pytest.mark.parametrize(("spacing", "is_other"), [(TOOTH, False), (0.995 * TOOTH, True)])
def test_mirrored_side_bands_have_the_same_spacing(spacing: float, is_other: bool) -> None:
    direct, mirrored = [CHATTER, CHATTER + spacing, CHATTER + 2 * spacing], [3 * TOOTH - CHATTER, 4 * TOOTH - CHATTER]
    peaks = lines(*direct, *([] if is_other else mirrored))
    assert has_other_spacing(ChatterPeaks(CHATTER, 0.01, peaks), TOOTH) is is_other


@pytest.mark.parametrize(
    ("off", "beyond"), [(3 * 17.3, 0.0), (-8 * 17.3 + 0.5, 0.0), (2.5 * 17.3, 1.0), (17.3 + 0.7, 1.0), (12 * 17.3, 1.0)]
)
def test_ripple_puts_lines_some_ripples_from_a_multiple_up_to_200_hz(off: float, beyond: float) -> None:
    far_apart = 1000.0
    assert Ripple(17.3, 0.3, 0.0).energy_beyond(lines(2 * far_apart + off), far_apart, BIN) == beyond
