"""Refusals that several parts of a spindle share."""

from __future__ import annotations

import math


def require_positive(where: str, name: str, value: float, unit: str, infinite: bool = False) -> None:
    """Raise ValueError unless the value is > 0 and finite; `infinite` lets infinity pass."""
    if not (value > 0 and (math.isfinite(value) or (infinite and value == math.inf))):
        rule = "a number > 0" if infinite else "a finite number > 0"
        raise ValueError(f"{where}{name}={value} is not {rule} ({unit})")


def require_not_negative(where: str, name: str, value: float, unit: str) -> None:
    """Raise ValueError unless the value is finite and >= 0."""
    if not (math.isfinite(value) and value >= 0):
        raise ValueError(f"{where}{name}={value} is not a finite number >= 0 ({unit})")
