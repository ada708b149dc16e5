"""A value with its standard error, as text."""

from __future__ import annotations

import math


def plus_minus(value: float, std: float | None, unit: str, scale: float = 1.0) -> str:
    """Value, standard error with two digits, unit and error in percent, e.g. "1326.8 ± 5.3 N/um (0.40 %)".

    Both are divided by `scale` first. None, or an error below 1e-7 of the value: without one.
    """
    shown = value / scale
    if std is None or not 1e-7 * abs(value) < std < math.inf:
        return f"{shown:.6g} {unit}"
    error = std / scale
    decimals = max(1 - math.floor(math.log10(error)), 0)
    return f"{shown:.{decimals}f} ± {error:.{decimals}f} {unit} ({100 * std / abs(value):.2g} %)"
