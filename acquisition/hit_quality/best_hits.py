"""Choice of the best hits where there are more than needed."""

from collections.abc import Sequence

import numpy as np

from acquisition.arrays import Complexes, Floats
from acquisition.estimation.estimate_frf import compute_cross_spectra, find_usable_band
from acquisition.hit import Hit
from acquisition.hits.free_decay import extract_free_decay


def choose_best_hits(hits: Sequence[Hit], wanted: int) -> list[int]:
    """Choose the hits that agree best with the median FRF and the median force spectrum of all.

    Both are compared line by line up to the end of the usable band that all hits share. The distance of a hit is the
    root of the mean square of 2 |A - M| / (|A| + |M|) over the lines of both curves, with A of the hit and M the
    median. The force spectrum counts by its shape, not by its size. Without a force the spectrum of the free decay
    counts. Of equal hits the earlier one is chosen.

    Parameters
    ----------
    hits
        Good hits of one set-up.
    wanted
        Number of hits to choose.

    Returns
    -------
    list of int
        Indices of the chosen hits, in their order; all where there are not more than wanted.

    Examples
    --------
    >>> time = np.arange(-100, 4000) / 10240.0
    >>> pulse = np.where((time >= 0) & (time <= 1e-3), np.sin(np.pi * time / 1e-3) ** 4, 0.0)
    >>> response = Structure(np.array([500.0]), np.array([0.02]), np.array([2e7])).response(time, 1e-3)
    >>> hits = [Hit(200 * pulse, gain * response, 10240.0, 100) for gain in (200.0, 230.0, 201.0, 199.0)]
    >>> choose_best_hits(hits, 3)
    [0, 2, 3]
    """
    if len(hits) <= wanted:
        return list(range(len(hits)))
    distances = _compare_frfs(hits) if hits[0].has_force else _compare_decays(hits)
    order = np.argsort(np.sqrt(np.mean(distances**2, axis=1)), kind="stable")
    return sorted(order[:wanted].tolist())


def _compare_frfs(hits: Sequence[Hit]) -> Floats:
    """Return the distance of each hit (row) from the median force spectrum and the median FRF, at each line."""
    spectra = [compute_cross_spectra([hit]) for hit in hits]
    powers, crosses = np.stack([each[0] for each in spectra]), np.stack([each[2] for each in spectra])
    frequency = np.fft.rfftfreq(hits[0].force.size, 1 / hits[0].sample_rate)
    end = min(find_usable_band(frequency, power)[1] for power in powers)
    lines = slice(1, max(int(np.searchsorted(frequency, end, side="right")), 2))
    frfs = crosses[:, lines] / np.maximum(powers[:, lines], np.finfo(np.float64).tiny)
    return np.hstack([_measure_distances(_normalize(np.sqrt(powers[:, lines]))), _measure_distances(frfs)])


def _compare_decays(hits: Sequence[Hit]) -> Floats:
    decays = [extract_free_decay(hit) for hit in hits]
    size = min(decay.size for decay in decays)
    return _measure_distances(_normalize(np.abs(np.fft.rfft([decay[:size] for decay in decays]))))


def _normalize(curves: Floats) -> Floats:
    return np.asarray(curves / np.linalg.norm(curves, axis=1, keepdims=True))


def _measure_distances(curves: Floats | Complexes) -> Floats:
    """Return the relative distance of each curve (row) from the median curve, at each line."""
    median = np.median(curves.real, axis=0) + 1j * np.median(curves.imag, axis=0)
    size = np.maximum(np.abs(curves) + np.abs(median), np.finfo(np.float64).tiny)
    return np.asarray(2 * np.abs(curves - median) / size)
