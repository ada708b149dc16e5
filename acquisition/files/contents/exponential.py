"""The window over a response that a file names: whether it is exponential, and how fast."""

from __future__ import annotations

import math
import re

_NONE = re.compile(r"\s*(none|no|off|rect\w*|uniform|boxcar|transient|force.*)?\s*", re.IGNORECASE)
_CONSTANT = re.compile(r"([\d.]+(?:[eE][+-]?\d+)?)\s*(m?)s\b")


def time_constant_of(window: str) -> float | None:
    """Of "exponential 0.05 s" (s); None where there is no window, NaN where it is not told how it falls."""
    if _NONE.fullmatch(window):
        return None
    constant = _CONSTANT.search(window)
    if constant is None or "exp" not in window.lower():
        return math.nan
    return float(constant[1]) * (1e-3 if constant[2] else 1.0)


def window_text(time_constant: float | None) -> str:
    """The same as text."""
    if time_constant is None:
        return "none"
    return "of unknown form" if math.isnan(time_constant) else f"exponential {time_constant!r} s"
