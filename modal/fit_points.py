"""Modes of several FRFs with the same poles: directions, or points of a structure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import chain

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from acquisition import Frf
from modal.extract import LARGEST_ERROR, LEAST_SHARE, LEAST_TERMS, ORDERS
from modal.find_resonances import Resonance, find_resonances
from modal.fit_band import BandFit, fit_band
from modal.fit_modes import of_one
from modal.line_weights import line_weights
from modal.local_bands import LocalBand, local_bands
from modal.mode import Mode
from modal.physical_poles import physical_poles
from modal.stabilise import stabilise
from modal.usable_lines import usable_lines

ROUNDS = 3
"""Fits of each band, the later ones without the tails of the other bands' modes."""


def fit_points(frfs: Sequence[Frf], band: tuple[float, float] | None = None) -> list[Mode]:
    """Modes that all these FRFs share, by rising frequency, each with its shape; maybe none.

    Poles come from all FRFs at once (LSCF, then least squares with common frequencies and damping ratios and a
    modal constant in each). The FRFs have one frequency axis; the first is the driving point that stiffness and
    covariance belong to, and shape holds the modal constants of all. Raises ValueError as `fit_modes`, for FRFs
    with different lines, and for a mode with no motion in the first FRF.
    """
    with threadpool_limits(limits=1):
        lines = [usable_lines(frf, band) for frf in _on_common_lines(frfs)]
        weights = np.array([line_weights(frf) for frf in lines])
        bands = local_bands(_merged([find_resonances(frf) for frf in lines]), lines[0].frequency)
        fits = _fits(lines, weights, bands)
    found = [_mode(fit, i) for fit in fits if fit is not None for i in range(fit.frequency.size)]
    return sorted(found, key=lambda mode: mode.frequency)


def _on_common_lines(frfs: Sequence[Frf]) -> list[Frf]:
    """All in the narrowest usable band."""
    if not frfs:
        raise ValueError("there is no FRF; give one or more, the driving point first")
    if any(not np.array_equal(frf.frequency, frfs[0].frequency) for frf in frfs):
        raise ValueError("the FRFs differ in their frequency lines; measure or export all with the same settings")
    usable = [frf.usable_band for frf in frfs if frf.usable_band is not None]
    common = (max(low for low, _ in usable), min(high for _, high in usable)) if usable else None
    return [replace(frf, usable_band=common) for frf in frfs]


def _merged(found: Sequence[list[Resonance]]) -> list[Resonance]:
    """Resonances of all FRFs, those nearer than a half-width taken as one (the highest)."""
    merged: list[Resonance] = []
    for new in sorted(chain.from_iterable(found), key=lambda r: -r.height):
        if all(abs(new.frequency - old.frequency) > max(new.half_width, old.half_width) for old in merged):
            merged.append(new)
    return sorted(merged, key=lambda r: r.frequency)


def _fits(lines: list[Frf], weights: NDArray[np.float64], bands: list[LocalBand]) -> list[BandFit | None]:
    """Band after band, and again with the modes of all other bands taken off."""
    receptance = np.array([frf.receptance for frf in lines])
    fits: list[BandFit | None] = [None] * len(bands)
    for _ in range(ROUNDS):
        for i, local in enumerate(bands):
            f = lines[0].frequency[local.lines]
            others = [fit.receptance(f) for fit in fits[:i] + fits[i + 1 :] if fit is not None]
            own = receptance[:, local.lines] - sum(others, np.zeros((len(lines), f.size), complex))
            weight = weights[:, local.lines]
            least = LEAST_SHARE * min(r.height for r in local.resonances)
            fits[i] = _fit(f, own, weight, _starts(f, own, weight, local), least)
    return fits


def _starts(
    f: NDArray[np.float64], own: NDArray[np.complex128], weight: NDArray[np.float64], local: LocalBand
) -> NDArray[np.float64]:
    """High LSCF poles, and the peaks that have none; frequencies and damping ratios, shape (2, m)."""
    poles = physical_poles(stabilise(f, own, weight, ORDERS))
    height = np.abs(poles.flexibility).max(axis=1) / poles.damping_ratio * poles.frequency
    starts = np.stack([poles.frequency, poles.damping_ratio])[:, height > LEAST_SHARE * np.max(height, initial=0)]
    alone = [r for r in local.resonances if not np.any(np.abs(starts[0] - r.frequency) < r.half_width)]
    return np.hstack([starts, np.array([(r.frequency, r.half_width / r.frequency) for r in alone]).reshape(-1, 2).T])


def _fit(
    f: NDArray[np.float64],
    receptance: NDArray[np.complex128],
    weight: NDArray[np.float64],
    starts: NDArray[np.float64],
    least: float,
) -> BandFit | None:
    """Fit without the weakest poles, one after another, until all that are left are modes."""
    while starts.size:
        fit = fit_band(f, receptance, weight, starts, LEAST_TERMS)
        if fit is not None and np.all(_are_modes(fit, f, least)):
            return fit
        weakest = int(np.argmin(fit.mobility_peak if fit is not None else -starts[1]))
        starts = np.delete(starts if fit is None else np.stack([fit.frequency, fit.damping_ratio]), weakest, axis=1)
    return None


def _are_modes(fit: BandFit, f: NDArray[np.float64], least: float) -> NDArray[np.bool_]:
    m = fit.frequency.size
    error = np.sqrt(np.diag(fit.covariance))
    constants = error[2 * m :].reshape(-1, m) / np.abs(fit.flexibility)
    return np.asarray(
        (fit.frequency > f[0])
        & (fit.frequency < f[-1])
        & (fit.mobility_peak > least)
        & (error[m : 2 * m] < LARGEST_ERROR * fit.damping_ratio)
        & (constants.min(axis=0) < LARGEST_ERROR)
    )


def _mode(fit: BandFit, i: int) -> Mode:
    constants = fit.flexibility[:, i]
    shape = constants / np.max(np.abs(constants)) * np.sign(constants[0])
    return Mode(
        float(fit.frequency[i]),
        float(fit.damping_ratio[i]),
        float(1 / constants[0]),
        of_one(fit.covariance, i, fit.flexibility[0]),
        fit.freedom,
        f"least squares of {constants.size} FRFs",
        shape=shape,
    )
