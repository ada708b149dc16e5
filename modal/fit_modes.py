"""Modes by LSCF and weighted least squares: the default."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from acquisition import Frf, Hit
from modal.assess import assess
from modal.extract import extract
from modal.extraction import Extraction, FittedBand
from modal.hammer_covariance import hammer_covariance
from modal.jackknife import jackknife, left_out
from modal.mode import Mode


def fit_modes(frf: Frf, band: tuple[float, float] | None = None, hits: Sequence[Hit] = ()) -> list[Mode]:
    """Modes from the lines between band[0] and band[1] (Hz), by rising frequency, each with its covariance; maybe none.

    Every resonance is fitted in a local band of some half-power widths, close ones together, from LSCF poles that
    stay where they are as the order grows; those without a peak of their own are taken where the sum of squares asks
    for them. Complex residual terms stand for what lies outside, and the tails of all other fitted modes are taken
    off. A line counts by its random error (from a smoothed coherence), or equally in the measured quantity where
    none is known; the covariance is scaled by the reduced chi-square. A peak is left out where least squares does
    not converge to a mode inside its local band, or leaves its damping ratio or stiffness uncertain by more than a
    third; `pick_peaks` may still list it. What else speaks against a mode stands in its `remarks`.

    hits: those that the FRF was averaged from (H1). Noise of the hammer is alike at neighbouring lines, so the fit does
    not see it: the covariance then has it from the baselines of the hits. With three or more the modes also have a
    jackknife over hits, which holds for any error that differs from hit to hit.

    Source: Peeters et al. (2004), Shock and Vibration 11, 395 (LSCF); Ewins, Modal Testing, ch. 4 (curve fitting
    with residual terms); Golub & Pereyra (1973), SIAM J. Numer. Anal. 10, 413.

    Raises ValueError for fewer than 8 usable lines, an FRF of zeros, one with its phase conjugated, one without
    phase, and hits that have other lines than the FRF or no pulse.
    """
    return modes_of(extract([frf], band), [hits])


def modes_of(state: Extraction, hits: Sequence[Sequence[Hit]] = ()) -> list[Mode]:
    """Modes of an extraction, by rising frequency; hits: for each of its FRFs those that it was averaged from."""
    if hits and len(hits) != len(state.frfs):
        raise ValueError(f"hits of {len(hits)} FRFs for {len(state.frfs)}; give a list of hits for each, maybe empty")
    without = [left_out(own, frf) for own, frf in zip(hits, state.frfs, strict=False)]
    found = [mode for band in state.bands for mode in _modes(state, band, hits, without)]
    return sorted(found, key=lambda mode: mode.frequency)


def _modes(
    state: Extraction, band: FittedBand, hits: Sequence[Sequence[Hit]], without: Sequence[Sequence[Frf]]
) -> list[Mode]:
    fit = band.fit
    covariance = fit.covariance + sum(hammer_covariance(state, band, i, own) for i, own in enumerate(hits))
    n_hits = min(map(len, without), default=0)
    scatter = np.sum([jackknife(state, band, *one) for one in enumerate(without)], axis=0) if n_hits else None
    modes = [
        Mode(
            float(fit.frequency[i]),
            float(fit.damping_ratio[i]),
            float(1 / fit.flexibility[0, i]),
            _of_one(covariance, i, fit.flexibility[0]),
            fit.freedom,
            _method(state, band),
            None if scatter is None else _of_one(scatter, i, fit.flexibility[0]),
            n_hits,
            shape=_shape(fit.flexibility[:, i]),
        )
        for i in range(fit.frequency.size)
    ]
    return [assess(state, band, i, mode) for i, mode in enumerate(modes)]


def _method(state: Extraction, band: FittedBand) -> str:
    f, p, m = state.frf.frequency[band.lines], len(state.frfs), band.height.size
    of, together = f" of {p} FRFs" if p > 1 else "", f", {m} modes together" if m > 1 else ""
    return f"least squares{of}, {f[0]:.0f}..{f[-1]:.0f} Hz{together}"


def _shape(flexibility: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """The largest of all FRFs 1 or -1, that of the driving point > 0; None of one FRF."""
    if flexibility.size == 1:
        return None
    return np.asarray(flexibility / np.max(np.abs(flexibility)) * np.sign(flexibility[0]))


def _of_one(covariance: NDArray[np.float64], i: int, flexibility: NDArray[np.float64]) -> NDArray[np.float64]:
    """Covariance of frequency, damping ratio and stiffness of mode i from that of all modes of a band."""
    mine = np.ix_(*2 * [[i, flexibility.size + i, 2 * flexibility.size + i]])
    chain = np.array([1.0, 1.0, -1 / flexibility[i] ** 2])
    return np.asarray(covariance[mine] * np.outer(chain, chain))
