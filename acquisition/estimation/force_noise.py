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
    parts = [windowed_force(hit) for hit in hits]
    time = np.arange(max(part.window.size for part in parts)) / hits[0].sample_rate
    waves = np.exp(-2j * np.pi * np.outer(frequency, time))
    spectra = [waves[:, : part.force.size] @ part.force for part in parts]
    power = np.sum(np.abs(spectra) ** 2, axis=0)
    for part, spectrum in zip(parts, spectra, strict=True):
        size = part.window.size
        columns = np.empty((frequency.size, size + 1), np.complex128)
        np.multiply(waves[:, :size], -part.noise * part.window, out=columns[:, :size])
        columns[:, size] = part.mean_noise * (waves[:, :size] @ part.window)
        columns *= (np.conj(spectrum) / power)[:, None]
        yield columns
