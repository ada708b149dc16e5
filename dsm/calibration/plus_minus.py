"""A value with its standard error, as text."""

from __future__ import annotations

import math
from decimal import Decimal
from typing import TypeGuard

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
    shown, behind = rounded(value, std, scale), f" {unit}" if unit and math.isfinite(value) else ""
    if not math.isfinite(value) or not _has_error(std, value):
        return f"{shown}{behind}"
    error, relative = std / scale, 100 * std / abs(value) if value else math.inf
    share = f" ({relative:.2g} %)" if relative < 99.5 else f" ({relative:.0f} %)"
    return f"{shown} ± {error:.{_decimals(error)}f}{behind}{share if percent else ''}"


def rounded(value: float, std: float | None = None, scale: float = 1.0, digits: int = 6) -> str:
    """Value with as many digits as its standard error leaves, e.g. "1326.8" of 1326.812 ± 5.3; "-" without a value.

    Both are divided by `scale` first. Without an error so many digits, eight where it is next to none; no exponent.

    >>> rounded(1326.812e6, 5.3e6, scale=1e6)
    '1326.8'
    >>> rounded(1.125e13, scale=1e6)
    '11250000'
    """
    if not math.isfinite(value):
        return "-"
    shown = value / scale + 0.0
    if _has_error(std, value):
        decimals = _decimals(std / scale)
        return f"{round(shown, decimals) + 0.0:.{decimals}f}"
    text = f"{shown:.{digits if std is None or not math.isfinite(std) else 8}g}"
    return f"{Decimal(text):f}" if "e" in text else text


def _has_error(std: float | None, value: float) -> TypeGuard[float]:
    return std is not None and math.isfinite(std) and std > SMALLEST * abs(value)


def _decimals(error: float) -> int:
    """Decimals that show two digits of an error, none where it is large."""
    return max(1 - math.floor(math.log10(error)), 0)
