"""A vibration mode as seen in one FRF."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Mode:
    """One mode: receptance 1/K / (1 - r^2 + 2i zeta r), r = f/f_n.

    The stiffness of a driving point is positive. A negative one is legal: it belongs to a response measured
    where the mode moves against the hammer, and says so (`is_driving_point`).
    """

    frequency: float
    """Undamped natural frequency f_n (Hz)."""
    damping_ratio: float
    """Viscous damping ratio zeta (-)."""
    stiffness: float
    """Modal stiffness K between hammer and sensor (N/m), signed."""
    covariance: NDArray[np.float64] | None = None
    """Covariance of (frequency, damping_ratio, stiffness), SI units, shape (3, 3); None where not estimated."""
    method: str = ""
    """How it was found."""

    def __post_init__(self) -> None:
        """Refuse what is no mode."""
        for name, value in (("frequency", self.frequency), ("damping_ratio", self.damping_ratio)):
            if not (np.isfinite(value) and value > 0):
                raise ValueError(f"{name}={value} is not a finite number > 0")
        if not np.isfinite(self.stiffness) or self.stiffness == 0:
            raise ValueError(f"stiffness={self.stiffness} is not a finite number other than 0 (N/m)")
        if self.covariance is not None and np.shape(self.covariance) != (3, 3):
            raise ValueError(f"covariance has shape {np.shape(self.covariance)}, not (3, 3)")

    @property
    def is_driving_point(self) -> bool:
        """True where hammer and sensor move together in this mode (positive stiffness)."""
        return self.stiffness > 0

    @property
    def standard_error(self) -> NDArray[np.float64]:
        """Standard errors of (frequency Hz, damping_ratio, stiffness N/m), shape (3,); NaN where not estimated."""
        if self.covariance is None:
            return np.full(3, np.nan)
        return np.sqrt(np.diag(self.covariance))

    def receptance(self, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Receptance of this mode alone (m/N), same shape as frequency (Hz)."""
        r = np.asarray(frequency) / self.frequency
        return np.asarray(1 / (self.stiffness * (1 - r**2 + 2j * self.damping_ratio * r)))
