"""A decay that all modes share, as an exponential window gives it to them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from modal.modes.mode import Mode

FEWEST, SPAN = 4, 3.0
"""Modes that agree, and the ratio of their highest frequency to the lowest, at least."""
SPREAD = 0.2
"""Standard deviation of the logarithms of their decay rates up to which these are alike; chosen. Over a span of 3 those
of equal damping ratios have 0.4 or more."""


def common_decay(modes: Sequence[Mode]) -> float | None:
    """Decay rate zeta w (1/s) that all these modes have about; None where they do not, or are too few to tell.

    Structures damp their modes by about equal damping ratios, so that decay rates grow with frequency. Under a window
    exp(-t/tau) that is shorter than their decay all rates are 1/tau, and damping ratios fall as 1/f.

    >>> windowed = [Mode(f, 1 / (0.05 * 2 * np.pi * f), 2e7) for f in (500.0, 900.0, 1300.0, 1900.0)]  # zeta w = 1/tau
    >>> round(1 / common_decay(windowed), 4)  # s: the time constant of the window
    0.05
    >>> common_decay([Mode(f, 0.02, 2e7) for f in (500.0, 900.0, 1300.0, 1900.0)]) is None
    True
    """
    if len(modes) < FEWEST:
        return None
    frequency = np.log([mode.frequency for mode in modes])
    rate = np.log([2 * np.pi * mode.damping_ratio * mode.frequency for mode in modes])
    are_alike = np.ptp(frequency) > np.log(SPAN) and np.std(rate) < SPREAD
    return float(np.exp(np.mean(rate))) if are_alike else None
