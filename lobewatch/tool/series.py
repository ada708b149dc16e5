"""What the tap tests of one tool and direction say together: their scatter, and how fast the frequency falls."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from datetime import datetime, timedelta
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

ENOUGH = 8
"""Number of tap tests from which on a series tells its own scatter."""
RECENT = 12
"""Largest number of tap tests that the rate of the fall is taken from; three at least."""


class FollowedMode(NamedTuple):
    """The mode followed in one tap test."""

    time: datetime
    """Time of the tap test."""
    frequency: float
    """Natural frequency (Hz)."""
    damping_ratio: float
    """Damping ratio (-)."""
    stiffness: float
    """Modal stiffness (N/m); NaN where no force was measured."""
    phase_deg: float = 0.0
    """Phase of the modal constant (degrees)."""


class Scatter(NamedTuple):
    """Half-widths that 95 % of tap tests stay within of the next, relative but for the phase."""

    frequency: float
    """Half-width of the natural frequency."""
    damping_ratio: float
    """Half-width of the damping ratio."""
    stiffness: float
    """Half-width of the stiffness."""
    phase_deg: float = 0.0
    """Half-width of the phase of the modal constant (degrees)."""


def scatter_of(series: Sequence[FollowedMode]) -> Scatter | None:
    """Scatter from the steps between neighbours, so that a slow fall does not count; None below 8 tap tests that know
    the stiffness."""
    known = [point for point in series if math.isfinite(point.stiffness)]
    if len(known) < ENOUGH:
        return None
    values = np.array([point[1:] for point in known])
    values[:, :3] = np.log(values[:, :3])
    return Scatter(*_half_widths(values).tolist())


def frequency_scatter(series: Sequence[FollowedMode]) -> float | None:
    """Half-width that 95 % of natural frequencies stay within of the next, relative; None below 8 tap tests."""
    if len(series) < ENOUGH:
        return None
    return float(_half_widths(np.log([[point.frequency] for point in series]))[0])


def _half_widths(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Half-widths of 95 % from the steps between neighbours; values of shape (n, k)."""
    steps = np.diff(values, axis=0)
    return np.asarray(np.std(steps, axis=0, ddof=1) / np.sqrt(2) * scipy.special.stdtrit(len(steps) - 1, 0.975))


def fall_in(series: Sequence[FollowedMode], days: float) -> float | None:
    """Relative fall of the frequency within so many days at the rate of the last tests; None where it is not known.

    A rise counts as none.
    """
    recent = series[-RECENT:]
    if len(recent) < 3:
        return None
    at = np.array([(point.time - recent[0].time) / timedelta(days=1) for point in recent])
    if np.ptp(at) == 0:
        return None
    slope = np.polyfit(at - at.mean(), np.log([point.frequency for point in recent]), 1)[0]
    return float(max(-slope * days, 0.0))


def frequency_at(series: Sequence[FollowedMode], time: datetime) -> float | None:
    """Natural frequency (Hz) at a time, linear between the tests before and after; None before the first."""
    behind = bisect_right(series, time, key=lambda point: point.time)
    if not behind:
        return None
    near = series[behind - 1 : behind + 1]
    times = [point.time.timestamp() for point in near]
    return float(np.interp(time.timestamp(), times, [point.frequency for point in near]))
