"""Array types of this package, and checks of numbers."""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
"""Real values (float64), of any shape."""
Complexes = NDArray[np.complex128]
"""Complex values (complex128), of any shape."""
Flags = NDArray[np.bool_]
"""Truth values, of any shape."""
Indices = NDArray[np.intp]
"""Places in an array, of any shape."""


def require_number(
    name: str, value: float | None, unit: str = "", note: str = "", *, positive: bool = False, infinite: bool = False
) -> None:
    """Raise ValueError unless the value is >= 0 (> 0 if `positive`) and finite; `infinite` lets infinity pass, too.

    None passes. `unit` is put behind the value, `note` at the end of the message.
    """
    if value is not None and (not (value > 0 if positive else value >= 0) or (value == math.inf and not infinite)):
        rule = f"a{'' if infinite else ' finite'} number {'>' if positive else '>='} 0"
        raise ValueError(f"{name}={value}{unit} is not {rule}{note}")


def require_numbers(where: str, part: object, units: Mapping[str, str], **rule: bool) -> None:
    """Check the numbers of a part named in `units` with require_number; `where` begins the message."""
    for name, unit in units.items():
        value = getattr(part, name)
        if not 0 < value < math.inf:  # a few only, as texts cost time
            require_number(where + name, value, "", f" ({unit})", **rule)


def check_numbers(
    name: str, values: ArrayLike, unit: str, needed: str, *, least: int = 0, positive: bool = False
) -> Floats:
    """Return values as an array of shape (n,), n at least `least`; ValueError for others and as require_number.

    `needed` is put behind "a 1-D array" in the message.
    """
    numbers = np.asarray(values, dtype=np.float64)
    if numbers.ndim != 1 or numbers.size < least:
        raise ValueError(f"{name} has shape {numbers.shape}. Give a 1-D array{needed}.")
    for bad in numbers[~(np.isfinite(numbers) & (numbers > 0 if positive else numbers >= 0))]:
        require_number(name, bad, unit, positive=positive)
    return numbers
