"""Families of lines that chatter is named by, made by hand."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from lobewatch.cuts.listening.chatter_lines import chatter_lines
from lobewatch.cuts.listening.spectrum import SpectralLines

BIN, TEETH = 1.0, 800.0
"""Bin and tooth frequency (Hz)."""


def lines(*pairs: tuple[float, float], clearness: float = 1e4) -> SpectralLines:
    """Lines (Hz, m/s^2)."""
    frequency, amplitude = np.array(pairs).T
    return SpectralLines(frequency, amplitude, np.full(frequency.size, clearness))


def chatter(*pairs: tuple[float, float]) -> tuple[float, Sequence[float]]:
    """Frequency of chatter among lines, and the lines of its family."""
    family = chatter_lines(lines(*pairs), TEETH, BIN)
    return family.frequency, family.lines.frequency.tolist()


def test_chatter_is_named_by_its_largest_displacement_and_has_all_lines_of_its_family() -> None:
    """Beside it a line that is louder, of less displacement and alone."""
    family = [(912.0, 0.05), (112.0, 0.001), (1712.0, 10.0), (2512.0, 9.0), (688.0, 0.2), (1488.0, 0.04)]
    assert chatter(*family, (3050.0, 12.0)) == (1712.0, [frequency for frequency, loud in family if loud > 0.01])
    assert chatter(*family, (3050.0, 12.0))[1][0] == 912.0


def test_multiples_of_chatter_with_side_bands_speak_for_it() -> None:
    """Chatter at 1300 Hz that leaves the cut sounds louder at 2 f and 3 f with side bands; those alone explain less."""
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
    assert len(chatter((1712.0, 10.0), (2512.0 + off, 1.0))[1]) == count
    assert len(chatter((1712.0, 10.0), (688.0 + off, 1.0))[1]) == count


def test_the_error_of_a_chatter_frequency_falls_with_its_clearness_down_to_3_hundredths_of_a_bin() -> None:
    for clearness in (25.0, 400.0, 1e9):
        error = chatter_lines(lines((1712.0, 1.0), clearness=clearness), TEETH, 0.8).error
        assert error == pytest.approx(0.8 * np.hypot(0.3 / np.sqrt(clearness), 0.03))
