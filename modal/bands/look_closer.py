"""What a band holds beside the modes that have a peak."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from modal.bands.compare_fits import is_better, is_likelier, is_white
from modal.bands.extraction import Array, FittedBand
from modal.bands.fit_peaks import LEAST_SHARE, are_modes
from modal.bands.suspected_pair import halved
from modal.bands.systematic import leaves_rounding, systematic
from modal.fitting import MOST_TERMS, fit_band, gain_of_a_term
from modal.poles import physical_poles

HIDDEN_F = 40.0
"""A mode without a peak of its own lowers the sum of squares by this many times what its unknowns do by chance."""
TERM_F = 6.0
"""A further residual term lowers it by this many times what two unknowns do by chance."""
HIDDEN_ERROR = 1 / 6
"""Relative standard error that damping ratio and stiffness of a mode without a peak have at most."""


def look_closer(band: FittedBand) -> FittedBand:
    """The band with those modes added that have no peak of their own, where the sum of squares asks for them.

    The same where its fit leaves nothing but independent errors, or rounding.
    """
    if is_white(band.fit) or leaves_rounding(band):
        return band
    bent = _with_terms(band)
    for starts in _more_modes(band, split=bent.terms > band.terms):
        height = np.full(starts.shape[1], np.max(band.height))
        fit = fit_band(band.data.frequency, band.data.own, band.data.weight, starts, band.terms)
        if fit is None or not is_better(fit, band.fit, TERM_F) or not is_likelier(fit, bent.fit):
            continue
        if is_better(fit, band.fit, HIDDEN_F) and np.all(are_modes(fit, band.data.frequency, height, HIDDEN_ERROR)):
            refitted = _with_terms(replace(band, fit=fit, height=height))
            if _is_sure(refitted):
                return refitted
        if is_white(fit) and np.all(are_modes(fit, band.data.frequency, height, np.inf)):
            bent = replace(bent, suspects=tuple(sorted(fit.frequency.tolist())))
    return bent


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
        yield halved(fitted, int(np.argmax(fit.mobility_peak)))


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
            or not is_better(fit, band.fit, TERM_F)
            or not np.all(are_modes(fit, data.frequency, band.height))
        ):
            break
        band = replace(band, fit=fit, terms=terms)
    return band
