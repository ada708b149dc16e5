"""The median of long arrays is that of numpy."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from acquisition.arrays import find_median


@given(arrays(np.float64, st.integers(1, 60), elements=st.floats(-1e50, 1e50)))
def test_the_median_is_that_of_numpy(values: np.ndarray[tuple[int], np.dtype[np.float64]]) -> None:
    before = values.copy()
    assert find_median(values) == np.median(values)
    assert np.array_equal(values, before)
