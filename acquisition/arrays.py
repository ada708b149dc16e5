"""Array types of this package."""

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
