"""A peak behind which two modes may stand, too close for their noise to be told apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modal.bands.compare_fits import is_likelier, is_white
from modal.bands.extraction import Array, FittedBand
from modal.bands.fit_peaks import are_modes
from modal.bands.left_about import noise_of
from modal.bands.systematic import leaves_rounding
from modal.fitting import fit_band, gain_of_a_pair

SURE = 9.0
"""Gain of a pair, over what each of its unknowns takes off by chance, which a mode alone has once in 8000 (exp -9)."""
SPLIT = 0.35
"""Half the distance at which two modes in place of one are tried (half-power half-widths)."""
WITHIN = 2.0
"""Standard errors that the size of a mode may change by where its stiffness is its own all the same."""
MORE_THAN_NOISE = 2.0
"""Times the noise (rms) that two modes in place of one leave at most."""
LINEAR = 0.01
"""Share (rms) of a mode below which what a pair adds to it means nothing: real peaks are no more linear than that."""


def with_suspects(band: FittedBand) -> FittedBand:
    """The band with the frequencies of two modes that may stand in place of one: its K is then that of both.

    They are said where the curve of one mode is surely not all that there is, two leave nothing but noise, and neither
    of them is as large as the one.
    """
    fit, data = band.fit, band.data
    if band.suspects or leaves_rounding(band):
        return band
    i = _no_single(band)
    if i is None:
        return band
    pair = fit_band(data.frequency, data.own, data.weight, halved(fit.poles, i), band.terms)
    if pair is None or not (is_white(pair) and is_likelier(pair, fit)):
        return band
    height = np.full(pair.frequency.size, np.max(band.height))
    larger = np.max(np.abs(pair.constant[0, -2:])) / abs(fit.constant[0, i])
    is_own = abs(larger - 1) < WITHIN * fit.size_error[0, i]
    if is_own or not np.all(are_modes(pair, data.frequency, height, np.inf)):
        return band
    return replace(band, suspects=tuple(sorted(pair.frequency[-2:].tolist())))


def _no_single(band: FittedBand) -> int | None:
    """The mode whose peak is least likely that of one mode alone; None where chance explains all of them, what a pair
    adds is next to nothing, or it leaves far more than noise."""
    fit, data = band.fit, band.data
    gains = [gain_of_a_pair(fit, data.frequency, data.weight, band.terms, i) for i in range(fit.frequency.size)]
    i, unknowns = int(np.argmax(gains)), 2 * len(data.own)
    chance = SURE * unknowns * fit.sum_of_squares / fit.freedom
    next_to_nothing = (LINEAR * float(np.linalg.norm(data.weight * fit.of_mode(i, data.frequency)))) ** 2
    noise = (MORE_THAN_NOISE * noise_of(fit)) ** 2 * fit.complex_residual.size
    return i if gains[i] > max(chance, next_to_nothing, fit.sum_of_squares - noise) else None


def halved(poles: Array, i: int) -> Array:
    """Poles with two in place of one, which come last, (2, m + 1)."""
    frequency, damping_ratio = poles[:, i]
    apart = SPLIT * damping_ratio * frequency
    pair = [[frequency - apart, frequency + apart], 2 * [damping_ratio]]
    return np.hstack([np.delete(poles, i, axis=1), pair])
