"""Modes by weighted least squares: the default."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from acquisition import Frf, Hit
from modal.bands.extract import extract
from modal.bands.extraction import Array, Extraction, FittedBand
from modal.bands.systematic import systematic
from modal.fitting import BandFit
from modal.force_dependence import with_force_remarks
from modal.hammer_covariance import hammer_covariance
from modal.jackknife import jackknife, left_out
from modal.modes.mode import UNKNOWN_PHASE, Mode, ratio_or_zero
from modal.quality.assess import assess, with_phase_remarks, with_smoothing_remarks


def fit_modes(frf: Frf, band: tuple[float, float] | None = None, hits: Sequence[Hit] = ()) -> list[Mode]:
    """Modes from the lines between band[0] and band[1] (Hz), by rising frequency, each with its covariance; maybe none.

    Every resonance is fitted in a local band of some half-power widths, close ones together, with complex modal
    constants, which are real where Akaike's criterion allows; modes without a peak of their own are taken where the
    sum of squares asks for them, from LSCF poles that stay where they are as the order grows. Complex residual terms
    stand for what lies outside, and the tails of all other fitted modes are taken off. A line counts by its random
    error (from a smoothed coherence), or equally in the measured quantity where none is known; the covariance is scaled
    by the reduced chi-square. A peak is left out where least squares does not converge to a mode inside its local band,
    or leaves its damping ratio or stiffness uncertain by more than a third; `pick_peaks` may still list it. What else
    speaks against a mode stands in its `remarks`.

    hits: those that the FRF was averaged from (H1). Noise of the hammer is alike at neighbouring lines, so the fit does
    not see it: the covariance then has it from the baselines of the hits. With three or more the modes also have a
    jackknife over hits, which holds for any error that differs from hit to hit.

    Source: Peeters et al. (2004), Shock and Vibration 11, 395 (LSCF); Ewins, Modal Testing, ch. 4 (curve fitting
    with residual terms); Golub & Pereyra (1973), SIAM J. Numer. Anal. 10, 413.

    Raises ValueError for fewer than 8 usable lines, an FRF of zeros, one with its phase conjugated, one without
    phase, and hits that have other lines than the FRF or no pulse.

    >>> frf = synthesize([Mode(500.0, 0.02, 2e7), Mode(520.0, 0.02, 4e7)], np.arange(1.0, 1501.0))
    >>> for mode in fit_modes(frf, band=(100.0, 1000.0)):
    ...     print(f"{mode.frequency:.2f} Hz, {mode.damping_ratio:.4f}, {mode.stiffness / 1e6:.2f} N/um")
    500.00 Hz, 0.0200, 20.00 N/um
    520.00 Hz, 0.0200, 40.00 N/um
    """
    return modes_of(extract([frf], band), [hits])


def modes_of(state: Extraction, hits: Sequence[Sequence[Hit]] = ()) -> list[Mode]:
    """Modes of an extraction, by rising frequency; hits: for each of its FRFs those that it was averaged from.

    Raises ValueError for another number of lists of hits than FRFs, and for hits that have other lines or no pulse.

    >>> state = extract([synthesize([Mode(500.0, 0.02, 2e7)], np.arange(1.0, 1501.0))])
    >>> [f"{mode.frequency:.1f} Hz" for mode in modes_of(state)]
    ['500.0 Hz']
    """
    if hits and len(hits) != len(state.frfs):
        raise ValueError(f"hits of {len(hits)} FRFs for {len(state.frfs)}; give a list of hits for each, maybe empty")
    without = [left_out(hits_of_frf, frf) for hits_of_frf, frf in zip(hits, state.frfs, strict=False)]
    modes = [mode for band in state.bands for mode in _modes(state, band, hits, without)]
    rising = sorted(modes, key=lambda mode: mode.frequency)
    return with_smoothing_remarks(state.frf, with_phase_remarks(rising))


def _modes(
    state: Extraction, band: FittedBand, hits: Sequence[Sequence[Hit]], without: Sequence[Sequence[Frf]]
) -> list[Mode]:
    by_hammer = sum(hammer_covariance(state, band, i, hits_of_frf) for i, hits_of_frf in enumerate(hits))
    n_hits = min(map(len, without), default=0)
    over_hits = np.sum([jackknife(state, band, *pair) for pair in enumerate(without)], axis=0) if n_hits else None
    judged = modes_of_band(state, band, by_hammer, over_hits, n_hits)
    return with_force_remarks(state, band, judged, hits[0], without[0]) if n_hits else judged


def modes_of_band(
    state: Extraction, band: FittedBand, by_hammer: Array | int, over_hits: Array | None, n_hits: int
) -> list[Mode]:
    """Modes of one band with their figures of quality; the covariances, of the hammer's noise and over this many hits,
    are in the order of `BandFit`."""
    fit, beyond = band.fit, systematic(band)
    covariance = fit.covariance * beyond.factor + by_hammer + beyond.covariance
    scatter = None if over_hits is None else over_hits + beyond.covariance
    modes = [_mode(fit, i, covariance, beyond.freedom, scatter, n_hits) for i in range(fit.frequency.size)]
    return [assess(state, band, i, replace(mode, method=_method(state, band))) for i, mode in enumerate(modes)]


def _mode(fit: BandFit, i: int, covariance: Array, freedom: float, scatter: Array | None, n_hits: int) -> Mode:
    """Mode i of a band, as the driving point shows it."""
    constant = complex(fit.constant[0, i])
    sign = 1.0 if constant.real > 0 else -1.0
    of_fit = _of_one(covariance, fit, i)
    over_hits = None if scatter is None else _of_one(scatter, fit, i)
    best = of_fit if over_hits is None else over_hits
    error = np.sqrt(np.diag(best))
    error[3] = np.hypot(error[3], np.degrees(fit.unasked[0, i]))
    return Mode(
        float(fit.frequency[i]),
        float(fit.damping_ratio[i]),
        sign / abs(constant),
        of_fit[:3, :3],
        freedom,
        jackknife=None if over_hits is None else over_hits[:3, :3],
        n_hits=n_hits,
        phase_deg=float(np.degrees(np.angle(sign * constant))),
        phase_deg_std=min(float(error[3]), UNKNOWN_PHASE),
        phase_correlation=ratio_or_zero(best[3, :3], error[3] * error[:3]),
        shape=_shape(fit.constant[:, i]),
    )


def _method(state: Extraction, band: FittedBand) -> str:
    f, p, m = state.frf.frequency[band.lines], len(state.frfs), band.height.size
    of, together = f" of {p} FRFs" if p > 1 else "", f", {m} modes together" if m > 1 else ""
    return f"least squares{of}, {f[0]:.0f}..{f[-1]:.0f} Hz{together}"


def _shape(constants: NDArray[np.complex128]) -> Array | None:
    """Part of each in phase with the driving point or against it, the largest 1 or -1; None of one FRF."""
    if constants.size == 1:
        return None
    along = np.real(constants * np.exp(-1j * np.angle(constants[0])))
    return np.asarray(along / np.max(np.abs(along)))


def _of_one(covariance: Array, fit: BandFit, i: int) -> Array:
    """Covariance of frequency, damping ratio, stiffness and phase (degrees) of mode i from that of its band, (4, 4)."""
    p, m = fit.constant.shape
    block = np.ix_(*2 * [[i, m + i, 2 * m + i, (2 + p) * m + i]])
    constant = fit.constant[0, i]
    by_size = -np.sign(constant.real) / abs(constant) ** 2
    scale = np.array([1.0, 1.0, by_size, np.degrees(1 / abs(constant))])
    return np.asarray(covariance[block] * np.outer(scale, scale))
