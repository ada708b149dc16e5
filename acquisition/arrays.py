"""Array types of this package, and the median of long arrays."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
"""Real values (float64), of any shape."""
AnyFloats = NDArray[np.floating[Any]]
"""Real values of any precision, of any shape."""
Complexes = NDArray[np.complex128]
"""Complex values (complex128), of any shape."""
Codes = NDArray[np.int32]
"""ADC codes (int32), of any shape."""
Indices = NDArray[np.intp]
"""Places in an array, of any shape."""
Flags = NDArray[np.bool_]
"""Truth values, of any shape."""


def find_median(values: Floats) -> float:
    """Return the median of real values without NaN as `numpy.median` does, with one partition instead of three."""
    middle = values.size // 2
    ordered = np.partition(values, middle)
    upper = float(ordered[middle])
    return upper if values.size % 2 else (float(ordered[:middle].max()) + upper) / 2
