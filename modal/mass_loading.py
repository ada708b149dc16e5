"""What a small mass that rides on a driving point does to a mode there."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from acquisition import Frf
from modal.modes.mode import Mode

BESIDE = 2.0
"""Half-power half-widths to either side of a mode at which it hides others less than on its peak."""


@dataclass(frozen=True)
class MassLoading:
    """Relative changes of a mode when a mass is put on, to first order."""

    frequency: float
    """Change of the natural frequency (-), < 0."""
    stiffness: float
    """Change of the modal stiffness (-)."""


def mass_loading(mode: Mode, frf: Frf, mass: float) -> MassLoading:
    """Change of a mode by a mass (kg) at the driving point whose FRF this is.

    With the modal mass M = K/w^2 the frequency falls by mass/(2 M). K follows the shape, which the mass bends towards
    the other modes: -2 mass w^2 R of itself, R the receptance at w of all others, those outside the lines, too.
    Source: first-order perturbation of K phi = w^2 M phi by mass e e^T, e.g. Ewins, Modal Testing, ch. 2.

    A sensor of 20 g on a single mode of K = 20 N/um at 500 Hz, M = K / w^2 = 2.03 kg: -m / (2 M)

    >>> mode = Mode(500.0, 0.02, 2e7)
    >>> loading = mass_loading(mode, synthesize([mode], np.arange(1.0, 1501.0)), 0.02)
    >>> f"{100 * loading.frequency:.2f} %, {100 * -0.02 * (2 * np.pi * 500.0) ** 2 / 2e7 / 2:.2f} %"
    '-0.49 %, -0.49 %'
    """
    w2 = (2 * np.pi * mode.frequency) ** 2
    places = mode.frequency * (1 + BESIDE * mode.damping_ratio * np.array([-1, 1]))
    lines = np.argmin(np.abs(frf.frequency[:, np.newaxis] - places), axis=0)
    others = np.mean(frf.receptance[lines] - mode.receptance(frf.frequency[lines]))
    return MassLoading(-0.5 * mass * w2 / mode.stiffness, float(-2 * mass * w2 * others.real))


def with_mass_doubt(mode: Mode, frf: Frf, mass_std: float) -> Mode:
    """The mode with what it may be off by because the mass that was taken off is known to a standard error (kg).

    >>> mode = Mode(500.0, 0.02, 2e7, covariance=np.diag([0.1, 0.001, 1e5]) ** 2)
    >>> doubted = with_mass_doubt(mode, synthesize([mode], np.arange(1.0, 1501.0)), mass_std=2e-3)
    >>> round(float(mode.fit_error[0]), 3), round(float(doubted.fit_error[0]), 3)  # Hz: 2 g are 0.25 Hz
    (0.1, 0.266)
    """
    loading = mass_loading(mode, frf, mass_std)
    off = loading.frequency * mode.frequency, loading.frequency * mode.damping_ratio, loading.stiffness * mode.stiffness
    more = np.outer(off, off)

    def widened(covariance: NDArray[np.float64] | None) -> NDArray[np.float64] | None:
        return None if covariance is None else covariance + more

    return replace(mode, covariance=widened(mode.covariance), jackknife=widened(mode.jackknife))
