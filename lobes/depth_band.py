"""How well a limit is known: from the measurement, and apart from it from the cutting coefficients."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lobes.coefficients import Coefficients
from lobes.cut import Cut
from lobes.program import Modes
from lobes.stability_lobes import StabilityLobes
from modal import Mode


class DepthBand(NamedTuple):
    """A band of limiting depths over speed."""

    low: NDArray[np.float64]
    """Lower edge (m), shape (n,)."""
    high: NDArray[np.float64]
    """Upper edge (m), shape (n,); inf where there is no limit."""


def measurement_band(limits: Callable[[Modes, Modes], StabilityLobes], x: Modes, y: Modes) -> DepthBand:
    """95 % band of the limiting depth from the covariances of the modes; modes without one count as exact.

    Sigma points: each root of each covariance is added and taken away, and the changes of the depth make its variance:
    the linear propagation with slopes taken over one standard error. For covariances over hits Student's t of the mode
    with the fewest hits replaces the normal distribution. `limits` is any method with cut and speeds set.
    """
    base = limits(x, y).depth
    variance = np.zeros(base.shape)
    for axis, modes in enumerate((x, y)):
        for i, mode in enumerate(modes or ()):
            for root in _roots(mode):
                sides = []
                for sign in (1.0, -1.0):
                    changed = [*(modes or ())]
                    changed[i] = _moved(mode, sign * root)
                    sides.append(limits(*((changed, y) if axis == 0 else (x, changed))).depth)
                variance += _half_difference(*sides) ** 2
    reach = max((mode.quantile() for modes in (x, y) for mode in modes or ()), default=0.0)
    spread = np.exp(reach * np.sqrt(variance))
    return DepthBand(base / spread, base * spread)


def coefficient_range(
    limits: Callable[[Cut], StabilityLobes], cut: Cut, published: Sequence[Coefficients]
) -> DepthBand:
    """Lowest and highest limit over published coefficients of one material: a range, no interval of confidence."""
    if not published:
        raise ValueError("published is empty; give the coefficients of one material at least")
    depths = [limits(replace(cut, tangential=one.tangential, radial=one.radial)).depth for one in published]
    return DepthBand(np.min(depths, axis=0), np.max(depths, axis=0))


def _roots(mode: Mode) -> NDArray[np.float64]:
    """Vectors (r, 3) whose outer products make up the covariance."""
    covariance = mode.best_covariance
    if covariance is None or not np.all(np.isfinite(covariance)):
        return np.empty((0, 3))
    scale = np.array([mode.frequency, mode.damping_ratio, mode.stiffness])
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    return np.asarray((vectors * np.sqrt(np.maximum(values, 0))).T)


def _moved(mode: Mode, step: NDArray[np.float64]) -> Mode:
    """The mode with its values changed by these logarithms."""
    frequency, damping, stiffness = np.exp(step) * (mode.frequency, mode.damping_ratio, mode.stiffness)
    return replace(mode, frequency=float(frequency), damping_ratio=float(damping), stiffness=float(stiffness))


def _half_difference(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """Half the difference of the logarithms of two depths; 0 where one has no limit."""
    known = np.isfinite(one) & np.isfinite(other)
    return np.where(known, np.log(np.where(known, one, 1.0) / np.where(known, other, 1.0)) / 2, 0.0)
