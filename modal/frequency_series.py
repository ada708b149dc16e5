"""Compare the frequencies of one mode over the hits of a tap test: constant, drift, change with force, two states."""

import enum
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy

from modal.arrays import Flags, Floats, Integers

MIN_CHI_SQUARE = 25.0
"""Least reduction of chi-square by a change: five standard errors."""
MIN_EXPLAINED_SHARE = 0.8
"""Least share of chi-square that a line over hit number or force explains; chosen."""
MIN_STATES_SHARE = 0.9
"""Least share of chi-square that two states explain; chosen: of a line over ten hits they explain 0.76."""
MAX_REST_OF_ERRORS = 2.0
"""Chi-square per degree of freedom up to which the errors explain the rest."""
SCATTER_PROBABILITY = 1e-3
"""Probability of chi-square that errors give; scatter exceeds it by `MIN_CHI_SQUARE`."""


class HitChangeKind(enum.StrEnum):
    """Kind of change from hit to hit."""

    DRIFT = "drift"
    """Frequency rises or falls from hit to hit."""
    FORCE = "force"
    """Frequency changes with the force of the hit."""
    TWO_STATES = "two-states"
    """Frequency has two values."""
    SCATTER = "scatter"
    """Frequency differs from hit to hit in no order."""
    PARTIAL = "partial"
    """Mode is missing in some hits."""


@dataclass(frozen=True, eq=False)
class FrequencyChange:
    """Change of a frequency, fitted by weighted least squares."""

    kind: HitChangeKind
    """Kind of change."""
    spread: float
    """Change from the first hit to the last, from the softest to the hardest, or from the lower state to the upper."""
    spread_std: float
    """Standard error of the spread, from the errors of the hits or, if larger, from the rest."""
    smaller_state: Flags
    """True for the hits in the state with fewer hits, shape (n,)."""
    rest: float = 0.0
    """Chi-square that the change leaves."""
    freedom: int = 1
    """Degrees of freedom of that rest."""


def find_frequency_change(
    number: Integers, frequency: Floats, error: Floats, force: Floats | None
) -> FrequencyChange | None:
    """Return how a frequency changes over the hits; None if it is constant within its errors.

    number: hit number; error: standard error of each frequency; force: peak force of each hit (N), None if unknown; all
    of shape (n,) with n of at least four.
    """
    weight = 1 / error**2
    total = _fit(np.ones((frequency.size, 1)), frequency, weight)[0]
    fits = [fit for fit in _fit_changes(number, frequency, weight, force) if _is_significant(fit, total)]
    if fits:
        return min(fits, key=_preference)
    if total < MIN_CHI_SQUARE + scipy.special.chdtri(frequency.size - 1, SCATTER_PROBABILITY):
        return None
    std = float(np.sqrt(2) * np.median(error))
    return FrequencyChange(HitChangeKind.SCATTER, float(np.ptp(frequency)), std, np.zeros(frequency.size, dtype=bool))


def _fit_changes(number: Integers, f: Floats, weight: Floats, force: Floats | None) -> Iterator[FrequencyChange]:
    nobody = np.zeros(f.size, dtype=bool)
    for kind, x in ((HitChangeKind.DRIFT, number), (HitChangeKind.FORCE, force)):
        if x is not None and np.ptp(x) > 0:
            share = np.asarray((x - np.min(x)) / np.ptp(x), np.float64)
            yield _fit_change(kind, share, f, weight, nobody, f.size - 2)
    order = np.argsort(f)
    uppers = [np.isin(np.arange(f.size), order[size:]) for size in range(2, f.size - 1)]
    halves = [
        _fit_change(HitChangeKind.TWO_STATES, upper.astype(float), f, weight, upper, f.size - 3) for upper in uppers
    ]
    yield min(halves, key=lambda fit: fit.rest)


def _fit_change(
    kind: HitChangeKind, x: Floats, f: Floats, weight: Floats, upper: Flags, freedom: int
) -> FrequencyChange:
    """Fit a change in proportion to x, which goes from 0 to 1."""
    rest, values, covariance = _fit(np.column_stack([np.ones(f.size), x]), f, weight)
    std = np.sqrt(covariance[1, 1] * max(1.0, rest / freedom))
    smaller = upper if np.count_nonzero(upper) <= f.size / 2 else ~upper
    return FrequencyChange(kind, float(values[1]), float(std), smaller, rest, freedom)


def _fit(columns: Floats, f: Floats, weight: Floats) -> tuple[float, Floats, Floats]:
    """Return chi-square, values and covariance of a linear fit."""
    covariance = np.asarray(np.linalg.inv(columns.T @ (columns * weight[:, np.newaxis])), np.float64)
    values = covariance @ (columns.T @ (weight * (f - np.mean(f))))
    rest = f - np.mean(f) - columns @ values
    return float(np.sum(weight * rest**2)), values, covariance


def _preference(fit: FrequencyChange) -> tuple[float, bool, float]:
    """Return the key of the fit that leaves least; a line before two states if both leave no more than the errors."""
    rest = fit.rest / fit.freedom
    return max(rest, MAX_REST_OF_ERRORS), fit.kind is HitChangeKind.TWO_STATES, rest


def _is_significant(fit: FrequencyChange, total: float) -> bool:
    """Return whether a change exceeds the errors, and explains its share or leaves no more than the errors.

    The best two states of any series explain up to two thirds of the scatter by the errors.
    """
    is_states = fit.kind is HitChangeKind.TWO_STATES
    share = MIN_STATES_SHARE if is_states else MIN_EXPLAINED_SHARE
    explains = fit.rest <= (1 - share) * total or fit.rest <= MAX_REST_OF_ERRORS * fit.freedom
    least = MIN_CHI_SQUARE * max(1.0, fit.rest / fit.freedom) + (fit.freedom if is_states else 0)
    return explains and total - fit.rest >= least
