"""Remarks and rounded values of calibration reports."""

import math
from dataclasses import dataclass
from decimal import Decimal
from typing import TypeGuard


@dataclass(frozen=True)
class FitRemark:
    """Remark on a fit. Programs use `code` and `about`; `text` and `cure` may be reworded."""

    code: str
    """Kind of remark: words in lower case joined by hyphens, never changed."""
    about: str
    """Groups or modes of the remark; empty for the whole."""
    text: str
    """Finding, with figures and units, without a full stop."""
    cure: str
    """Remedy."""

    def __str__(self) -> str:
        """Return finding and remedy."""
        return ": ".join(filter(None, (self.about, self.text))) + f". {self.cure}."


MIN_SHOWN_ERROR_SHARE = 1e-7
"""Least relative error that is shown: fits of computed data have smaller ones."""


def format_with_error(
    value: float, std: float | None, scale: float = 1.0, unit: str = "", *, percent: bool = False
) -> str:
    """Format a value and its standard error with two digits of the error.

    Parameters
    ----------
    value : float
        Value.
    std : float or None
        Standard error; not shown if None, NaN, infinite, or almost zero.
    scale : float
        Divisor of both (-).
    unit : str
        Unit after scaling.
    percent : bool
        Add the relative error.

    Returns
    -------
    str
        Text such as "1326.8 ± 5.3 N/um (0.4 %)"; "-" without a value.

    Examples
    --------
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
    """Format a value with as many digits as its standard error justifies, without exponent.

    Parameters
    ----------
    value : float
        Value.
    std : float, optional
        Standard error.
    scale : float
        Divisor of both (-).
    digits : int
        Number of digits without an error; eight if the error is almost zero.

    Returns
    -------
    str
        Text such as "1326.8"; "-" without a value.

    Examples
    --------
    >>> format_rounded(1326.812e6, 5.3e6, scale=1e6)
    '1326.8'
    >>> format_rounded(1.125e13, scale=1e6)
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
    """Return the decimals that show two digits of an error, none if it is large."""
    return max(1 - math.floor(math.log10(error)), 0)
