"""Peaks of a curve, compared with scipy.signal."""

import numpy as np
import pytest
from scipy.signal import find_peaks, peak_prominences

from modal.peaks import peaks, prominences


@pytest.mark.parametrize("levels", [2, 4, 30, 10**9])
def test_peaks_and_prominences_are_those_of_scipy(levels: int) -> None:
    random = np.random.default_rng(levels)
    for length in [*range(1, 12), *[300] * 20]:
        values = random.integers(levels, size=length).astype(float)
        tops = peaks(values)
        assert tops.tolist() == find_peaks(values)[0].tolist()
        assert prominences(values, tops).tolist() == peak_prominences(values, tops)[0].tolist()


def test_prominences_of_some_peaks_where_the_curve_is_cut_off_below() -> None:
    values = np.random.default_rng(5).normal(size=500)
    tops = peaks(values)[values[peaks(values)] > 0]
    cut_off = np.maximum(values, -0.5)
    assert prominences(cut_off, tops).tolist() == peak_prominences(cut_off, tops)[0].tolist()
