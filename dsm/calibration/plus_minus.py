"""A value with its standard error, as text."""

from __future__ import annotations

import math

SMALLEST = 1e-7
"""Share of its value below which an error is not shown: a fit of computed data has such."""


def plus_minus(value: float, std: float | None, scale: float = 1.0, unit: str = "", *, percent: bool = False) -> str:
    """Value and standard error with two digits of the error, e.g. "1326.8 ± 5.3 N/um (0.40 %)"; "-" without a value.

    Both are divided by `scale` first. Without an error where there is none (None, NaN, infinite) or next to none.

    >>> plus_minus(1326.8e6, 5.3e6, scale=1e6, unit="N/um", percent=True)
    '1326.8 ± 5.3 N/um (0.4 %)'
    >>> plus_minus(696.2, None, unit="Hz")
    '696.2 Hz'
    """
    if not math.isfinite(value):
        return "-"
    shown, behind = value / scale + 0.0, f" {unit}" if unit else ""
    if std is None or not math.isfinite(std):
        return f"{shown:.6g}{behind}"
    if std <= SMALLEST * abs(value):
        return f"{shown:.8g}{behind}"
    error = std / scale
    decimals = max(1 - math.floor(math.log10(error)), 0)
    share = f" ({100 * std / abs(value):.2g} %)" if percent else ""
    return f"{round(shown, decimals) + 0.0:.{decimals}f} ± {error:.{decimals}f}{behind}{share}"
