"""Modes by LSCF and least squares: the default."""

from __future__ import annotations

import numpy as np

from acquisition import Frf
from modal.extract import Extraction, FittedBand, extract
from modal.mode import Mode


def fit_modes(frf: Frf, band: tuple[float, float] | None = None) -> list[Mode]:
    """x."""
    state = extract(frf, band)
    modes = [_mode(state, band, i) for band in state.bands for i in range(band.height.size)]
    return sorted(modes, key=lambda mode: mode.frequency)


def _mode(state: Extraction, band: FittedBand, i: int) -> Mode:
    f, n, fit = state.frf.frequency[band.lines], band.height.size, band.fit
    method = f"least squares, {f[0]:.0f}..{f[-1]:.0f} Hz" + (f", {n} modes together" if n > 1 else "")
    stiffness = float(1 / fit.flexibility[0, i])
    chain = np.array([1.0, 1.0, -(stiffness**2)])
    mine = [i, n + i, 2 * n + i]
    covariance = fit.covariance[np.ix_(mine, mine)] * np.outer(chain, chain)
    return Mode(float(fit.frequency[i]), float(fit.damping_ratio[i]), stiffness, covariance, method)
