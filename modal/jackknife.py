"""How far modes scatter from hit to hit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from acquisition import Frf, Hit, without_mass
from acquisition.estimation import cross_spectra
from modal.bands.extraction import Extraction, FittedBand

FEWEST_HITS = 3
"""With two the interval would be 6 times wider than the error is likely to be."""


def left_out(hits: Sequence[Hit], frf: Frf) -> list[Frf]:
    """FRFs (H1) of all hits but one, for each hit, on the lines of frf; none for fewer than three hits.

    The spectra of each hit are worked out once, and taken from their sum.

    Raises ValueError where a hit has other lines than the FRF.
    """
    parts = [_lines(hit, frf) for hit in hits]
    if len(hits) < FEWEST_HITS:
        return []
    lines = parts[0]
    spectra = [(s_ff[1:][lines], s_fx[1:][lines]) for s_ff, _, s_fx in (cross_spectra([hit]) for hit in hits)]
    s_ff, s_fx = (np.sum(column, axis=0) for column in zip(*spectra, strict=True))
    per_line = -1 / (2 * np.pi * frf.frequency) ** 2
    fewer = (Frf(frf.frequency, (s_fx - fx) / (s_ff - ff) * per_line) for ff, fx in spectra)
    return [without_mass(one_less, frf.mass_removed) for one_less in fewer]


def _lines(hit: Hit, frf: Frf) -> slice:
    """Those of frf among the lines above 0 Hz that an FRF of this hit has."""
    frequency = np.fft.rfftfreq(hit.force.size, 1 / hit.sample_rate)[1:]
    first = int(np.searchsorted(frequency, frf.frequency[0]))
    part = slice(first, first + frf.frequency.size)
    if not np.array_equal(frequency[part], frf.frequency):
        raise ValueError("hits and FRF differ in their frequency lines; give the hits that this FRF was averaged from")
    return part


def jackknife(state: Extraction, band: FittedBand, i: int, without: Sequence[Frf]) -> NDArray[np.float64]:
    """Covariance of the values of one band, (n - 1)/n times the sum of squares over FRF i without one hit each.

    Each is refitted by one Gauss-Newton step from the fit to all hits, which is exact to first order in the change;
    shape as `BandFit.covariance`. Source: Efron & Stein (1981), The jackknife estimate of variance, Annals of
    Statistics 9, 586.
    """
    all_hits = np.mean([frf.receptance[band.lines] for frf in without], axis=0)
    steps, n = changes(state, band, i, without, all_hits), len(without)
    return np.asarray((n - 1) / n * steps.T @ steps)


def changes(
    state: Extraction, band: FittedBand, i: int, without: Sequence[Frf], reference: NDArray[np.complex128]
) -> NDArray[np.float64]:
    """What the values of a band change by when FRF i is one of these instead of the reference (m/N, on its lines).

    A row each, to first order; columns as `BandFit.covariance`.
    """
    part = band.lines
    change = (np.array([frf.receptance[part] for frf in without]) - reference) * state.weight[i, part]
    return np.asarray(np.concatenate([change.real, change.imag], axis=1) @ band.fit.influence_of(i).T)
