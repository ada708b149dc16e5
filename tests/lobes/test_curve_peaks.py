"""Peaks with prominence against scipy on curves with plateaus and ties."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray
from scipy.signal import find_peaks

from lobes.pockets import find_curve_peaks

pytestmark = pytest.mark.quick

STEPS = arrays(np.float64, st.integers(1, 60), elements=st.integers(0, 9).map(float))
SMOOTH = arrays(np.float64, st.integers(1, 200), elements=st.floats(-1e3, 1e3, width=32))


@given(STEPS | SMOOTH, st.sampled_from([0.0, 1.0, 2.0, 5.0]))
def test_the_peaks_are_those_of_scipy(values: NDArray[np.float64], prominence: float) -> None:
    expected = find_peaks(values, plateau_size=1, prominence=prominence)[0]
    np.testing.assert_array_equal(find_curve_peaks(values, prominence), expected)


def test_a_small_peak_on_the_flank_of_a_large_one_does_not_count() -> None:
    values = np.array([0.0, 4.0, 3.5, 10.0, 0.0, 2.0, 2.0, 0.0])
    assert list(find_curve_peaks(values, 1.0)) == [3, 5]
    assert list(find_curve_peaks(values, 0.5)) == [1, 3, 5]
