"""Which of two fits of a band is to be preferred, and whether one leaves nothing but noise."""

from __future__ import annotations

import numpy as np

from modal.fitting import BandFit

BLOCKS = 48
"""Runs of lines that the means of what a fit leaves are looked at in."""
WHITE = 1.0
"""Standard deviations that their size may lie above what independent errors have."""


def is_white(fit: BandFit) -> bool:
    """Whether the means of neighbouring lines are as small as those of independent errors."""
    left = fit.complex_residual
    length = max(2, left.shape[1] // BLOCKS)
    blocks = left[:, : left.shape[1] // length * length].reshape(len(left), -1, length)
    size = np.sum(np.abs(blocks.mean(axis=2)) ** 2) * length
    expected = fit.sum_of_squares / left.size * blocks[..., 0].size
    return bool(size < expected * (1 + WHITE / np.sqrt(blocks[..., 0].size)))


def is_better(more: BandFit, fewer: BandFit, least: float) -> bool:
    """Whether the sum of squares falls by more than `least` times what the further unknowns take off by chance."""
    gain = (fewer.sum_of_squares - more.sum_of_squares) / max(fewer.freedom - more.freedom, 1)
    return gain > least * more.sum_of_squares / more.freedom


def is_likelier(fit: BandFit, other: BandFit) -> bool:
    """By the information criterion of Akaike (sum of squares and number of unknowns)."""
    variance = min(candidate.sum_of_squares / candidate.freedom for candidate in (fit, other))
    return fit.sum_of_squares - 2 * variance * fit.freedom < other.sum_of_squares - 2 * variance * other.freedom
