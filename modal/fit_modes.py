"""Modes by local least squares: the default."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition import Frf
from modal.find_resonances import find_resonances
from modal.fit_band import BandFit, fit_band
from modal.line_weights import line_weights
from modal.local_bands import LocalBand, local_bands
from modal.mode import Mode
from modal.usable_lines import usable_lines

SWEEPS = 3
"""Rounds over the local bands after the first, each with the tails of the other bands' modes taken off."""
LARGEST_ERROR = 1 / 3
"""Relative standard error of damping ratio and stiffness above which a peak is not a mode."""

LEAST_SHARE = 0.05
"""Share of its peak of the mobility that a mode has; 1 dB of prominence needs twice this."""


def fit_modes(frf: Frf, band: tuple[float, float] | None = None) -> list[Mode]:
    """Modes from the lines between band[0] and band[1] (Hz), by rising frequency, each with its covariance; maybe none.

    Every resonance is fitted in a local band of some half-power widths, close ones together, with complex
    residual terms for what lies outside; then again with the tails of all other fitted modes taken off. A line
    counts by its random error, or equally in the measured quantity where none is known; the covariance is scaled
    by the reduced chi-square. A peak is left out where least squares does not converge to a mode inside its local
    band, or leaves its damping ratio or stiffness uncertain by more than a third; `pick_peaks` may still list it.
    A band that cuts off neighbouring modes leaves their tails to the residual terms; to choose among modes, fit
    them all and use `predominant`.
    Source: Ewins, Modal Testing, ch. 4 (curve fitting with residuals).

    Raises ValueError for fewer than 8 usable lines, an FRF of zeros, and one with its phase conjugated.
    """
    lines = usable_lines(frf, band)
    weight = line_weights(lines)
    fits = [_fit(lines, weight, _first(local), []) for local in local_bands(find_resonances(lines), lines.frequency)]
    for _ in range(SWEEPS if len(fits) > 1 else 0):
        for i, last in enumerate(fits):
            others = [other.fit for other in fits[:i] + fits[i + 1 :] if other is not None]
            fits[i] = None if last is None else _fit(lines, weight, last.again, others)
    modes = [
        mode for fitted in fits if fitted is not None for mode in _modes(fitted.fit, lines.frequency[fitted.where])
    ]
    return sorted(modes, key=lambda mode: mode.frequency)


@dataclass(frozen=True, eq=False)
class _Guess:
    """Modes to be fitted on some lines: frequencies (Hz), damping ratios, heights of their peaks (m/s/N), each (m,)."""

    where: slice
    frequency: NDArray[np.float64]
    damping_ratio: NDArray[np.float64]
    height: NDArray[np.float64]

    def only(self, keep: NDArray[np.bool_]) -> _Guess:
        return _Guess(self.where, self.frequency[keep], self.damping_ratio[keep], self.height[keep])


@dataclass(frozen=True, eq=False)
class _Fitted:
    where: slice
    fit: BandFit
    height: NDArray[np.float64]

    @property
    def again(self) -> _Guess:
        return _Guess(self.where, self.fit.frequency, self.fit.damping_ratio, self.height)


def _first(local: LocalBand) -> _Guess:
    frequency, half_width, height = np.array([(r.frequency, r.half_width, r.height) for r in local.resonances]).T
    return _Guess(local.lines, frequency, half_width / frequency, height)


def _fit(lines: Frf, weight: NDArray[np.float64], guess: _Guess, others: list[BandFit]) -> _Fitted | None:
    """Fit of what is left after the weakest of those that turn out to be no modes are taken out, one by one."""
    f = lines.frequency[guess.where]
    tails = sum((other.receptance(f)[0] for other in others), np.zeros(f.size, complex))
    own = lines.receptance[guess.where] - tails
    while guess.height.size:
        fit = fit_band(f, own[None], weight[None, guess.where], np.stack([guess.frequency, guess.damping_ratio]))
        sure = np.zeros(guess.height.size, bool) if fit is None else _are_modes(fit, f, guess.height)
        if fit is not None and np.all(sure):
            return _Fitted(guess.where, fit, guess.height)
        weakest = np.argmin(np.where(sure, np.inf, guess.height))
        guess = guess.only(np.arange(sure.size) != weakest)
    return None


def _are_modes(fit: BandFit, frequency: NDArray[np.float64], height: NDArray[np.float64]) -> NDArray[np.bool_]:
    _, damping_error, flexibility_error = fit.standard_error
    return np.asarray(
        (fit.frequency > frequency[0])
        & (fit.frequency < frequency[-1])
        & (fit.damping_ratio > 0)
        & (fit.damping_ratio < 1)
        & (fit.mobility_peak > LEAST_SHARE * height)
        & (damping_error < LARGEST_ERROR * fit.damping_ratio)
        & (flexibility_error < LARGEST_ERROR * np.abs(fit.flexibility[0]))
    )


def _modes(fit: BandFit, frequency: NDArray[np.float64]) -> Iterator[Mode]:
    n = fit.frequency.size
    method = f"least squares, {frequency[0]:.0f}..{frequency[-1]:.0f} Hz" + (f", {n} modes together" if n > 1 else "")
    for i in range(n):
        stiffness = float(1 / fit.flexibility[0, i])
        chain = np.array([1.0, 1.0, -(stiffness**2)])
        mine = np.ix_([i, n + i, 2 * n + i], [i, n + i, 2 * n + i])
        covariance = fit.covariance[mine] * np.outer(chain, chain)
        yield Mode(float(fit.frequency[i]), float(fit.damping_ratio[i]), stiffness, covariance, method)
