"""Modes of free decays: what a structure does after a hit whose force nobody measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from acquisition import Frf, from_accelerance
from modal.bands.extract import extract
from modal.bands.extraction import Array, Extraction, FittedBand
from modal.fit_modes import modes_of_band
from modal.jackknife import FEWEST_HITS
from modal.modes.mode import Mode

WITHOUT_MEANING = ("not-driving-point", "near-node")
"""Remarks on sign and size of K, which decays do not show."""


def fit_decays(decays: ArrayLike, sample_rate: float, band: tuple[float, float] | None = None) -> list[Mode]:
    """Modes of free decays (m/s^2), shape (p, n), between band[0] and band[1] (Hz), by rising frequency; maybe none.

    Natural frequency and damping ratio with their errors; K is NaN, for it needs the force. `decay_spectra`, `extract`
    and `modes_of_decays` one after the other. sample_rate in Hz.

    Raises ValueError as `fit_modes`, and for decays of zeros, values that are not finite, or fewer than 32 samples.

    >>> time = np.arange(2048) / 10240.0  # s
    >>> decay = np.exp(-0.02 * 2 * np.pi * 500.0 * time) * np.cos(2 * np.pi * 500.0 * np.sqrt(1 - 0.02**2) * time)
    >>> (mode,) = fit_decays([300.0 * decay, 200.0 * decay, 250.0 * decay], 10240.0)  # m/s^2, Hz
    >>> f"{mode.frequency:.2f} Hz, {mode.damping_ratio:.4f}, K {mode.stiffness}"
    '500.00 Hz, 0.0200, K nan'
    """
    return modes_of_decays(extract(decay_spectra(decays, sample_rate), band))


def decay_spectra(decays: ArrayLike, sample_rate: float) -> list[Frf]:
    """Spectra of free decays (m/s^2), shape (p, n), each as the FRF of a force of 1 N s at its first sample.

    The spectrum of a decay that begins at once and has ended with the record is the sum of r / (i w - lambda): the
    poles are those of the structure; what the hit was, and when, is in r alone, another one for each decay. So they
    are fitted together with common poles and never averaged. What is left of the force after the first sample is
    smooth over the lines of a mode, and does not move its pole either.

    sample_rate in Hz. Raises ValueError for fewer than 32 samples, values that are not finite, and decays of one value.

    Source: Ewins, Modal Testing, ch. 2 and 4; Brown, Allemang, Zimmerman & Mergeay (1979), SAE paper 790221.

    >>> time = np.arange(2048) / 10240.0  # s
    >>> decay = np.exp(-0.02 * 2 * np.pi * 500.0 * time) * np.sin(2 * np.pi * 500.0 * time)
    >>> (spectrum,) = decay_spectra([300.0 * decay], 10240.0)
    >>> float(spectrum.frequency[abs(spectrum.accelerance).argmax()]), spectrum.measured_as  # Hz
    (500.0, 'accelerance')
    """
    records = np.atleast_2d(np.asarray(decays, dtype=np.float64))
    if records.ndim != 2 or records.shape[1] < 32:
        raise ValueError(f"decays have shape {records.shape}; give (p, n) with 32 samples or more each")
    if not np.all(np.isfinite(records)) or not np.all(np.ptp(records, axis=1)):
        raise ValueError("a decay holds values that are not finite, or nothing but one value: leave it out")
    frequency = np.fft.rfftfreq(records.shape[1], 1 / sample_rate)
    return [from_accelerance(frequency, np.fft.rfft(record) / sample_rate) for record in records]


def modes_of_decays(state: Extraction) -> list[Mode]:
    """Modes of an extraction from `decay_spectra`, by rising frequency.

    From three decays on with errors over the decays: each one moves the common values by its part of a Gauss-Newton
    step, and these parts scatter as whatever differs from decay to decay does (a sandwich with the decays as clusters).
    Source: Liang & Zeger (1986), Biometrika 73, 13.
    """
    pairs = [pair for band in state.bands for pair in _modes(state, band)]
    highest = max((height for _, height in pairs), default=1.0)
    modes = [_without_stiffness(mode, height / highest) for mode, height in pairs]
    return sorted(modes, key=lambda mode: mode.frequency)


def _modes(state: Extraction, band: FittedBand) -> Sequence[tuple[Mode, float]]:
    """Modes of a band with the heights of their peaks, rms over the decays."""
    enough = len(state.frfs) >= FEWEST_HITS
    modes = modes_of_band(state, band, 0, _over_decays(band) if enough else None, len(state.frfs) if enough else 0)
    heights = np.sqrt(np.mean(np.abs(band.fit.constant) ** 2, axis=0)) / (2 * band.fit.damping_ratio)
    return list(zip(modes, heights.tolist(), strict=True))


def _over_decays(band: FittedBand) -> Array:
    """Covariance of the values of a band by how its decays pull at them; shape as `BandFit.covariance`."""
    fit, count = band.fit, len(band.fit.constant)
    parts = fit.residual.reshape(count, -1)
    pulls = [part @ fit.influence_of(i).T for i, part in enumerate(parts)]
    outer = np.transpose(pulls) @ np.array(pulls)
    return np.asarray(count / (count - 1) * fit.residual.size / fit.freedom * outer)


def _without_stiffness(mode: Mode, relative_peak: float) -> Mode:
    """What decays tell of a mode."""
    return replace(
        mode,
        stiffness=np.nan,
        covariance=_poles_alone(mode.covariance),
        jackknife=_poles_alone(mode.jackknife),
        phase_deg=0.0,
        phase_deg_std=0.0,
        phase_correlation=None,
        shape=None,
        relative_peak=relative_peak,
        remarks=tuple(remark for remark in mode.remarks if remark.code not in WITHOUT_MEANING),
    )


def _poles_alone(covariance: NDArray[np.float64] | None) -> NDArray[np.float64] | None:
    """That of frequency and damping ratio; NaN for the stiffness."""
    if covariance is None:
        return None
    known = np.full((3, 3), np.nan)
    known[:2, :2] = covariance[:2, :2]
    return known
