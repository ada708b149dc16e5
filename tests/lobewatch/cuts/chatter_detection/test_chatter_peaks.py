"""Families of lines that chatter is named by, made by hand."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from lobewatch.cuts.chatter_detection.peak_classification import find_chatter_peaks
from lobewatch.cuts.chatter_detection.spectrum import SpectralPeaks

pytestmark = pytest.mark.quick

BIN, TEETH = 0.8, 800.0
"""Bin and tooth frequency (Hz)."""


def lines(*pairs: tuple[float, float], clearness: float = 1e4) -> SpectralPeaks:
    """Lines (Hz, m/s^2)."""
    frequency, amplitude = np.array(pairs).T
    return SpectralPeaks(frequency, amplitude, np.full(frequency.size, clearness))


def chatter(*pairs: tuple[float, float]) -> tuple[float, Sequence[float]]:
    """Frequency of chatter among lines, and the lines of its family."""
    family = find_chatter_peaks(lines(*pairs), TEETH, BIN)
    return family.frequency, family.peaks.frequency.tolist()


def test_chatter_is_named_by_its_largest_displacement_and_has_all_lines_of_its_family() -> None:
    """A single louder line of less displacement is present too."""
    family = [(912.0, 0.05), (112.0, 0.001), (1712.0, 10.0), (2512.0, 9.0), (688.0, 0.2), (1488.0, 0.04)]
    assert chatter(*family, (3050.0, 12.0)) == (1712.0, [frequency for frequency, loud in family if loud > 0.01])
    assert chatter(*family, (3050.0, 12.0))[1][0] == 912.0


def test_multiples_of_chatter_with_side_bands_speak_for_it() -> None:
    """Chatter at 1300 Hz that leaves the cut sounds louder at 2 f and 3 f with side bands; each alone explains less."""
    base = [(1300.0, 5.0), (2100.0, 1.0)]
    double = [(2600.0, 9.0), (1800.0, 9.0), (1000.0, 2.0)]
    triple = [(3900.0, 9.0), (3100.0, 2.0)]
    frequency, family = chatter(*base, *double, *triple)
    assert (frequency, family) == (1300.0, [1300.0, 2100.0])


def test_faint_lines_of_a_large_displacement_name_no_chatter() -> None:
    """A tenth of the loudest amplitude names it."""
    for share, name in ((0.095, 1712.0), (0.105, 150.0)):
        assert chatter((150.0, share * 10.0), (1712.0, 10.0))[0] == name


@pytest.mark.parametrize(("off", "count"), [(1.15, 2), (-1.15, 2), (1.25, 1), (-1.25, 1)])
def test_a_line_is_of_a_family_within_1_2_bins(off: float, count: int) -> None:
    assert len(chatter((1712.0, 10.0), (2512.0 + off * BIN, 1.0))[1]) == count
    assert len(chatter((1712.0, 10.0), (688.0 + off * BIN, 1.0))[1]) == count


def test_the_error_of_a_chatter_frequency_falls_with_its_clearness_down_to_3_hundredths_of_a_bin() -> None:
    for clearness in (25.0, 400.0, 1e9):
        error = find_chatter_peaks(lines((1712.0, 1.0), clearness=clearness), TEETH, BIN).error
        assert error == pytest.approx(BIN * np.hypot(0.3 / np.sqrt(clearness), 0.03))


def named(share: float, *pairs: tuple[float, float]) -> float:
    """Return the chatter frequency found among 1450 Hz, 1310 Hz with a share of its energy, and other peaks (Hz)."""
    amplitude = 10.0 * np.sqrt(share) * (1310.0 / 1450.0) ** 2
    return chatter((1450.0, 10.0), (1310.0, amplitude), *pairs)[0]


@pytest.mark.parametrize(("order", "reach"), [(1, 1.2), (2, 1.2), (3, 1.8)])
@pytest.mark.parametrize("side", [-1, 1])
def test_a_multiple_speaks_for_chatter_within_1_2_bins_and_a_third_one_within_1_8(
    order: int, reach: float, side: int
) -> None:
    for bins, name in ((reach - 0.05, 1310.0), (reach + 0.05, 1450.0)):
        band = order * 1310.0 + 800.0 + side * bins * BIN
        assert named(0.9, (band, 0.5)) == name


def test_the_fourth_multiple_speaks_for_none() -> None:
    assert named(0.9, (3 * 1310.0, 0.5)) == 1310.0
    assert named(0.9, (4 * 1310.0, 0.5)) == 1450.0


@pytest.mark.parametrize(("share", "name"), [(0.27, 1310.0), (0.23, 1450.0)])
def test_what_names_chatter_has_a_quarter_of_the_largest_displacement_energy(share: float, name: float) -> None:
    multiples = [(order * 1310.0 + turns * 800.0, 0.5) for order in (2, 3) for turns in (-1, 0, 1)]
    assert named(share, *multiples) == name


def test_of_two_that_explain_as_much_the_larger_displacement_names_chatter() -> None:
    assert named(0.9) == 1450.0
    assert named(1.1) == 1310.0


@pytest.mark.parametrize(("clearness", "frequency"), [(4.5, 1450.0), (5.7, 1310.0)])
def test_lines_speak_as_they_stand_clear_and_displacement_counts_three_tenths(
    clearness: float, frequency: float
) -> None:
    """Explained 4 + log c against 4, displacement 0.5 against 1: 1 + 0.3 / 2 is 4 / (4 + log c) + 0.3 at c = 5.1."""
    amplitude = 10.0 * np.sqrt(0.5) * (1310.0 / 1450.0) ** 2
    heard = SpectralPeaks(
        np.array([1450.0, 1310.0, 2620.0]), np.array([10.0, amplitude, 0.5]), np.array([1e4, 1e4, clearness])
    )
    assert find_chatter_peaks(heard, TEETH, BIN).frequency == frequency


def test_the_largest_displacement_is_found_among_many_loud_lines() -> None:
    strangers = [(5000.0 + 33.7 * number, 20.0) for number in range(15)]
    assert chatter(*strangers, (1450.0, 10.0), (2250.0, 5.0)) == (1450.0, [1450.0, 2250.0])
