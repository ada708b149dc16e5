"""Remarks and rounded values of calibration reports."""

from __future__ import annotations

import math
from dataclasses import dataclass
from decimal import Decimal
from typing import TypeGuard


@dataclass(frozen=True)
class FitRemark:
    """One thing to know. Programs look at `code` and `about`; `text` and `cure` are for people and may be reworded."""

    code: str
    """Kind of remark: words in lower case joined by hyphens, never changed."""
    about: str
    """Groups or modes that it concerns; empty for the whole."""
    text: str
    """Finding, with figures and units, without a full stop."""
    cure: str
    """Advice what to do about it."""

    def __str__(self) -> str:
        """One sentence."""
        return ": ".join(filter(None, (self.about, self.text))) + f"; {self.cure}"


MIN_SHOWN_ERROR_SHARE = 1e-7
"""Share of its value below which an error is not shown: a fit of computed data has such."""


def format_with_error(
    value: float, std: float | None, scale: float = 1.0, unit: str = "", *, percent: bool = False
) -> str:
    """Value and standard error with two digits of the error, e.g. "1326.8 ± 5.3 N/um (0.40 %)"; "-" without a value.

    Both are divided by `scale` first. Without an error where there is none (None, NaN, infinite) or next to none.

    >>> format_with_error(1326.8e6, 5.3e6, scale=1e6, unit="N/um", percent=True)
    '1326.8 ± 5.3 N/um (0.4 %)'
    >>> format_with_error(696.2, None, unit="Hz")
    '696.2 Hz'
    """
    shown, behind = format_rounded(value, std, scale), f" {unit}" if unit and math.isfinite(value) else ""
    if not math.isfinite(value) or not _has_error(std, value):
        return f"{shown}{behind}"
    error, relative = std / scale, 100 * std / abs(value) if value else math.inf
    share = f" ({relative:.2g} %)" if relative < 99.5 else f" ({relative:.0f} %)"
    return f"{shown} ± {error:.{_error_decimals(error)}f}{behind}{share if percent else ''}"


def format_rounded(value: float, std: float | None = None, scale: float = 1.0, digits: int = 6) -> str:
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
        decimals = _error_decimals(std / scale)
        return f"{round(shown, decimals) + 0.0:.{decimals}f}"
    text = f"{shown:.{digits if std is None or not math.isfinite(std) else 8}g}"
    return f"{Decimal(text):f}" if "e" in text else text


def _has_error(std: float | None, value: float) -> TypeGuard[float]:
    return std is not None and math.isfinite(std) and std > MIN_SHOWN_ERROR_SHARE * abs(value)


def _error_decimals(error: float) -> int:
    """Decimals that show two digits of an error, none where it is large."""
    return max(1 - math.floor(math.log10(error)), 0)
