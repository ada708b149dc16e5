"""The window over the response of a MATLAB file: named by a variable, or seen in the signals before and behind it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

_NAME = re.compile(r"(response_?)?window(_?type)?", re.IGNORECASE)
_LOUD = 0.02
"""Share of the largest value above which a sample tells the window ..."""
_OFF = 0.02
"""... which is exponential where the logarithms lie so close to a straight line (rms)."""


def window_of(variables: Mapping[str, Any]) -> str:
    """As `Contents.window`."""
    named = next((value for name, value in variables.items() if _NAME.fullmatch(name) and isinstance(value, str)), "")
    responses = (name[1:] for name in variables if re.fullmatch(r"W([2-9]|\d\d)", name))
    windows = [_seen(variables.get(f"X{number}"), variables[f"W{number}"]) for number in responses]
    return named or next(filter(None, windows), "")


def _seen(before: Any, behind: Any) -> str:
    """The window between two signals (n, 2) of time and value; empty where they are the same, or none."""
    if not all(isinstance(pairs, np.ndarray) and pairs.ndim == 2 and pairs.shape[1] == 2 for pairs in (before, behind)):
        return ""
    if before.shape != behind.shape or not np.any(before[:, 1]) or np.array_equal(before[:, 1], behind[:, 1]):
        return ""
    time, raw, windowed = np.real(before[:, 0]), np.real(before[:, 1]), np.real(behind[:, 1])
    loud = np.abs(raw) > _LOUD * np.max(np.abs(raw))
    ratio = windowed[loud] / raw[loud]
    if ratio.size < 3 or np.any(ratio <= 0):
        return "of unknown form"
    return _fall(time[loud], np.log(ratio))


def _fall(time: NDArray[np.float64], level: NDArray[np.float64]) -> str:
    """level: logarithm of the window."""
    slope, start = np.polyfit(time, level, 1)
    if np.std(level - slope * time - start) > _OFF or slope > 0:
        return "of unknown form"
    return "" if -slope * np.ptp(time) < _OFF else f"exponential {-1 / slope:.4g} s"
