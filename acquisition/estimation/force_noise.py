"""What noise of the hammer does to an averaged FRF."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from acquisition.hit import Hit
from acquisition.hits.windowed_force import windowed_force


def force_noise(hits: Sequence[Hit], frequency: NDArray[np.float64]) -> Iterator[NDArray[np.complex128]]:
    """Errors that noise of the hammer brings into H1 at these lines (Hz), as shares of it; an array for each hit.

    Column t of that of hit i, shape (n, samples in its force window + 1), is the error that one standard deviation of
    the noise at sample t makes, to first order:

        -sigma_i w_i(t) conj(F_i) exp(-2 pi j f t) / sum_k |F_k|^2

    F_i(f) is the spectrum of the windowed force, w_i the window, sigma_i the rms of the baseline, in which the noise
    is taken as white. The last column is that of the mean of the baseline, which is taken off all samples. Each column
    has an independent real factor of variance one, and is smooth over lines closer than one over the window's length.

    Source: H1 of `estimate_frf` with F + N for F, expanded in N. Raises ValueError for a hit without a pulse.
    """
    yield from force_noise_through(np.eye(frequency.size), hits, frequency)


def force_noise_through(
    rows: NDArray[np.complex128] | NDArray[np.float64], hits: Sequence[Hit], frequency: NDArray[np.float64]
) -> Iterator[NDArray[np.complex128]]:
    """What linear maps (k, n) make of each array of `force_noise`, without making that: shape (k, samples + 1)."""
    parts = [windowed_force(hit) for hit in hits]
    time = np.arange(max(part.window.size for part in parts)) / hits[0].sample_rate
    waves = np.exp(-2j * np.pi * np.outer(frequency, time))
    spectra = [waves[:, : part.force.size] @ part.force for part in parts]
    power = np.sum(np.abs(spectra) ** 2, axis=0)
    for part, spectrum in zip(parts, spectra, strict=True):
        response = (rows * (np.conj(spectrum) / power)) @ waves[:, : part.window.size]
        yield np.column_stack((response * (-part.noise * part.window), response @ (part.mean_noise * part.window)))
