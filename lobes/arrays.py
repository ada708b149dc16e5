"""Array types of this package."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
"""Real values (float64), of any shape."""
Complexes = NDArray[np.complex128]
"""Complex values (complex128), of any shape."""
Flags = NDArray[np.bool_]
"""Truth values, of any shape."""
Indices = NDArray[np.intp]
"""Places in an array, of any shape."""
Integers = NDArray[np.int64]
"""Whole numbers (int64), of any shape."""
