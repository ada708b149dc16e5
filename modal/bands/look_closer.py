"""What a band holds beside the modes that have a peak."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from modal.bands.extraction import Array, FittedBand
from modal.bands.fit_peaks import LEAST_SHARE, are_modes
from modal.bands.systematic import leaves_rounding, systematic
from modal.fitting import MOST_TERMS, BandFit, fit_band, gain_of_a_term
from modal.poles import physical_poles

BLOCKS = 48
"""Runs of lines that the means of what a fit leaves are looked at in."""
WHITE = 1.0
"""Standard deviations that their size may lie above what independent errors have."""
HIDDEN_F = 40.0
"""A mode without a peak of its own lowers the sum of squares by this many times what its unknowns do by chance."""
TERM_F = 6.0
"""A further residual term lowers it by this many times what two unknowns do by chance."""
SPLIT = 0.35
"""Half the distance at which two modes in place of one are tried (half-power half-widths)."""
HIDDEN_ERROR = 1 / 6
"""Relative standard error that damping ratio and stiffness of a mode without a peak have at most."""


def look_closer(band: FittedBand) -> FittedBand:
    """The band with those modes added that have no peak of their own, where the sum of squares asks for them.

    The same where its fit leaves nothing but independent errors, or rounding.
    """
    if _is_white(band.fit) or leaves_rounding(band):
        return band
    bent = _with_terms(band)
    for starts in _more_modes(band, split=bent.terms > band.terms):
        height = np.full(starts.shape[1], np.max(band.height))
        fit = fit_band(band.data.frequency, band.data.own, band.data.weight, starts, band.terms)
        if fit is None or not _is_better(fit, band.fit, TERM_F) or not _is_likelier(fit, bent.fit):
            continue
        if _is_better(fit, band.fit, HIDDEN_F) and np.all(are_modes(fit, band.data.frequency, height, HIDDEN_ERROR)):
            refitted = _with_terms(replace(band, fit=fit, height=height))
            if _is_sure(refitted):
                return refitted
        if _is_white(fit) and np.all(are_modes(fit, band.data.frequency, height, np.inf)):
            bent = replace(bent, suspects=tuple(sorted(fit.frequency.tolist())))
    return bent


def _is_white(fit: BandFit) -> bool:
    """Whether the means of neighbouring lines are as small as those of independent errors."""
    left = fit.complex_residual
    length = max(2, left.shape[1] // BLOCKS)
    blocks = left[:, : left.shape[1] // length * length].reshape(len(left), -1, length)
    size = np.sum(np.abs(blocks.mean(axis=2)) ** 2) * length
    expected = fit.sum_of_squares / left.size * blocks[..., 0].size
    return bool(size < expected * (1 + WHITE / np.sqrt(blocks[..., 0].size)))


def _is_sure(band: FittedBand) -> bool:
    """Whether all its modes are known well enough when what the model lacks counts, too."""
    more, fit = systematic(band), band.fit
    error = np.sqrt(np.diag(more.factor * fit.covariance + more.covariance)).reshape(-1, fit.frequency.size)
    sizes = error[2 : 2 + len(fit.constant)] / np.abs(fit.constant)
    return bool(np.all(error[1] < HIDDEN_ERROR * fit.damping_ratio) and np.all(np.any(sizes < HIDDEN_ERROR, axis=0)))


def _more_modes(band: FittedBand, split: bool) -> Iterator[Array]:
    """Starts (2, m) for more modes than are fitted, from all high LSCF poles down; then two for the highest mode."""
    fit, poles = band.fit, physical_poles(band.data.chart)
    fitted = fit.poles
    size = np.pi * poles.frequency * poles.largest / poles.damping_ratio
    high = size > LEAST_SHARE * np.max(band.height)
    starts = np.stack([poles.frequency, poles.damping_ratio])[:, high]
    alone = [k for k in range(band.height.size) if not np.any(np.abs(starts[0] - fitted[0, k]) < np.prod(fitted[:, k]))]
    starts, size = np.hstack([starts, fitted[:, alone]]), np.concatenate([size[high], fit.mobility_peak[alone]])
    for n in range(size.size, band.height.size, -1):
        yield starts[:, np.argsort(-size)[:n]]
    if split:
        i = int(np.argmax(fit.mobility_peak))
        apart = SPLIT * fitted[1, i] * fitted[0, i]
        halves = [[fitted[0, i] - apart, fitted[0, i] + apart], 2 * [fitted[1, i]]]
        yield np.hstack([np.delete(fitted, i, axis=1), halves])


def _with_terms(band: FittedBand) -> FittedBand:
    """The band with as many residual terms as lower the sum of squares for more than by chance."""
    data = band.data
    for terms in range(band.terms + 1, MOST_TERMS + 1):
        least = TERM_F * len(data.own) * band.fit.sum_of_squares / band.fit.freedom
        if gain_of_a_term(band.fit, data.frequency, data.weight, terms - 1) < least:
            break
        fit = fit_band(data.frequency, data.own, data.weight, band.fit.poles, terms)
        if (
            fit is None
            or not _is_better(fit, band.fit, TERM_F)
            or not np.all(are_modes(fit, data.frequency, band.height))
        ):
            break
        band = replace(band, fit=fit, terms=terms)
    return band


def _is_better(more: BandFit, fewer: BandFit, least: float) -> bool:
    """Whether the sum of squares falls by more than `least` times what the further unknowns take off by chance."""
    gain = (fewer.sum_of_squares - more.sum_of_squares) / max(fewer.freedom - more.freedom, 1)
    return gain > least * more.sum_of_squares / more.freedom


def _is_likelier(fit: BandFit, other: BandFit) -> bool:
    """By the information criterion of Akaike (sum of squares and number of unknowns)."""
    variance = min(candidate.sum_of_squares / candidate.freedom for candidate in (fit, other))
    return fit.sum_of_squares - 2 * variance * fit.freedom < other.sum_of_squares - 2 * variance * other.freedom
