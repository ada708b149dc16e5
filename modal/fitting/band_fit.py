"""What a fit of a band found."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from modal.fitting.fit_at_poles import Array, ComplexArray, FitAtPoles


@dataclass(frozen=True, eq=False)
class BandFit:
    """Values of m modes that were fitted together in p FRFs.

    Errors come in the order: all frequencies, all damping ratios, then FRF by FRF what every modal constant is off
    along itself (its size), then FRF by FRF what it is off across (its phase, times its size): 2 m + 2 p m values.
    """

    frequency: Array
    """Natural frequencies (Hz), shape (m,)."""
    damping_ratio: Array
    """Damping ratios (-), shape (m,)."""
    constant: ComplexArray
    """Modal constants A (m/N), shape (p, m); all of them real where complex ones were not asked for."""
    freedom: int
    """Real values that were fitted less unknowns."""
    with_phases: FitAtPoles
    """The fit with complex constants, whose errors are those of the modes."""
    residual: Array
    """Residuals of the weighted FRFs, each its real and then its imaginary part, shape (2 n p,)."""
    unasked: Array
    """Phases (rad) that complex constants would have where they were not asked for, shape (p, m); else 0."""
    held: NDArray[np.bool_]
    """Modes whose frequency and damping ratio were given and have no error, shape (m,)."""

    @cached_property
    def covariance(self) -> Array:
        """Of the errors, by what the fit leaves, shape (2 m + 2 p m, 2 m + 2 p m)."""
        return self.with_phases.covariance * (self.sum_of_squares / self.freedom)

    @property
    def influence(self) -> Array:
        """Errors by a change of the weighted FRFs, one Gauss-Newton step, shape (2 m + 2 p m, 2 n p)."""
        return self.with_phases.influence

    @property
    def standard_error(self) -> Array:
        """Standard errors, shape (2 + 2 p, m)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)).reshape(-1, self.frequency.size))

    @property
    def size_error(self) -> Array:
        """Standard errors of the sizes of the modal constants, relative to them, shape (p, m)."""
        return np.asarray(self.standard_error[2 : 2 + len(self.constant)] / np.abs(self.constant))

    @property
    def complex_residual(self) -> ComplexArray:
        """The residual line by line, shape (p, n)."""
        parts = self.residual.reshape(len(self.constant), 2, -1)
        return np.asarray(parts[:, 0] + 1j * parts[:, 1])

    @property
    def mobility_peak(self) -> Array:
        """|mobility| of each mode alone at its natural frequency, largest of all FRFs (m/s/N), shape (m,)."""
        return np.asarray(np.pi * self.frequency * np.abs(self.constant / self.damping_ratio).max(axis=0))

    @property
    def poles(self) -> Array:
        """Natural frequencies (Hz) and damping ratios, shape (2, m)."""
        return np.stack([self.frequency, self.damping_ratio])

    @property
    def sum_of_squares(self) -> float:
        """Of the weighted residuals."""
        return float(self.residual @ self.residual)

    def influence_of(self, i: int) -> Array:
        """The part of the influence that belongs to FRF i, shape (2 m + 2 p m, 2 n)."""
        return np.hsplit(self.influence, len(self.constant))[i]

    def of_mode(self, i: int, frequency: Array) -> ComplexArray:
        """Mode i alone (m/N) at these frequencies (Hz), shape (p, n)."""
        return replace(
            self, frequency=self.frequency[[i]], damping_ratio=self.damping_ratio[[i]], constant=self.constant[:, [i]]
        ).receptance(frequency)

    def receptance(self, frequency: Array) -> ComplexArray:
        """Sum of these modes alone (m/N) at these frequencies (Hz), shape (p, n)."""
        fn, zeta = self.poles[:, :, np.newaxis]
        r = frequency / fn
        turn = self.constant.imag / np.sqrt(1 - zeta[:, 0] ** 2)
        steady = self.constant.real + turn * zeta[:, 0]
        curve = 1 / (1 - r**2 + 2j * zeta * r)
        return np.asarray(steady @ curve + 1j * turn @ (r * curve))


def split(values: ComplexArray) -> Array:
    """Real, then imaginary parts along the last axis."""
    return np.concatenate([values.real, values.imag], axis=-1)
