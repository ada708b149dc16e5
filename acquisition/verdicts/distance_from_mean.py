"""How far the FRF of one hit lies from the mean of the hits before it."""

from __future__ import annotations

import numpy as np

from acquisition.frf import Frf

FLOOR = 0.05
"""Relative scatter that no line is trusted below: it bounds the weight of a line."""


def distance_from_mean(frf: Frf, mean: Frf) -> tuple[float, float]:
    """Relative distance of a hit's FRF from the mean where both reach, and what the noise alone would give.

    A line counts with d = 2 |H - M| / (|H| + |M|), which no line can drive beyond 2, and with the weight
    1 / (0.05^2 + e^2); e^2 = (1 + 1/n) n/(n - 1) 2 n r^2 is the variance of one hit against the mean of n, from the
    random error r of that mean. Root of the weighted mean of d^2; of e^2 for the noise. Source of r: Bendat & Piersol.

    Raises ValueError where the lines differ or the mean has fewer than 3 hits or no coherence.
    """
    error, n = mean.random_error, mean.n_averages
    if error is None:
        raise ValueError(f"a mean of {n} hits (with its coherence) cannot tell how far hits scatter; 3 are needed")
    if not np.array_equal(frf.frequency, mean.frequency):
        raise ValueError(
            f"the hit has {frf.frequency.size} lines up to {frf.frequency[-1]:g} Hz, the mean "
            f"{mean.frequency.size} up to {mean.frequency[-1]:g} Hz; compare hits of one set-up only"
        )
    reach = min(response.usable_band[1] if response.usable_band else np.inf for response in (frf, mean))
    used = mean.frequency <= reach
    hit, expected = frf.receptance[used], mean.receptance[used]
    scatter = np.minimum((1 + 1 / n) * n / (n - 1) * 2 * n * error[used] ** 2, 4.0)
    weight = 1 / (FLOOR**2 + scatter)
    apart = 2 * np.abs(hit - expected) / np.maximum(np.abs(hit) + np.abs(expected), np.finfo(float).tiny)
    return float(np.sqrt(np.average(apart**2, weights=weight))), float(np.sqrt(np.average(scatter, weights=weight)))
