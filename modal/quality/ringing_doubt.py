"""What a mode may be off by because its record ended before its decay."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from modal.modes.mode import UNKNOWN_PHASE, Mode, ratio_or_zero
from modal.quality.trust import MOST_LEFT


def with_ringing_doubt(mode: Mode) -> Mode:
    """The mode with what is left of its decay when the record ends in its errors.

    On the lines of the record (multiples of one over its length T) all of the mode is 1 - exp(lambda T) of itself, with
    a size of exp(-zeta w T) = left_ringing and a phase that is not known: K and the phase of the modal constant are off
    by up to that share, by 1/sqrt(2) of it in the mean of squares. f and zeta are so only where the hit came late in
    the record or zeros were appended to it, by less; they get the same share of zeta f and of zeta. Where more than 5 %
    is left the errors stay: that is doubtful, and lines that come from no record, but were computed, have none of it.

    Source: integral of exp((lambda - iw) t) from 0 to T.

    >>> mode = Mode(500.0, 0.01, 2e7, np.diag([0.01, 1e-4, 1e5]) ** 2, left_ringing=0.04)
    >>> [f"{error:.2g}" for error in with_ringing_doubt(mode).standard_error]  # Hz, -, N/m
    ['0.14', '0.0003', '5.7e+05']
    """
    if not mode.left_ringing or mode.left_ringing > MOST_LEFT:
        return mode
    share = mode.left_ringing / np.sqrt(2)
    off = share * np.array([mode.damping_ratio * mode.frequency, mode.damping_ratio, mode.stiffness])
    widened = replace(mode, covariance=_widened(mode.covariance, off), jackknife=_widened(mode.jackknife, off))
    of_phase = min(float(np.hypot(mode.phase_deg_std, np.degrees(share))), UNKNOWN_PHASE)
    if mode.phase_correlation is None or mode.best_covariance is None:
        return replace(widened, phase_deg_std=of_phase)
    kept = ratio_or_zero(mode.standard_error * mode.phase_deg_std, widened.standard_error * of_phase)
    return replace(widened, phase_deg_std=of_phase, phase_correlation=mode.phase_correlation * kept)


def _widened(covariance: NDArray[np.float64] | None, off: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """With further independent errors of what has one: a value that a person holds has none."""
    return None if covariance is None else covariance + np.diag(np.where(np.diag(covariance) > 0, off, 0.0) ** 2)
