"""Natural modes of a spindle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Modes:
    """Undamped natural modes, lowest first, scaled to a modal mass of 1 kg."""

    frequency: NDArray[np.float64]
    """Natural frequencies (Hz), shape (n_modes,)."""
    position: NDArray[np.float64]
    """Places along the shaft from the tool tip (m), shape (n_nodes,)."""
    deflection: NDArray[np.float64]
    """Deflection (kg^-1/2), shape (n_modes, n_nodes)."""
    slope: NDArray[np.float64]
    """Slope of the deflection (kg^-1/2 m^-1), shape (n_modes, n_nodes)."""

    def deflection_at(self, position: float) -> NDArray[np.float64]:
        """Deflection at the nearest of the places (m), shape (n_modes,); modes_at is exact at any place."""
        return np.asarray(self.deflection[:, np.argmin(np.abs(self.position - position))])

    def stiffness_at(self, position: float) -> NDArray[np.float64]:
        """Modal stiffness w^2/deflection^2 there (N/m), shape (n_modes,); inf where the mode is at rest.

        The driving-point receptance is the sum over modes of 1/K/(1 - (f/f_n)^2).
        """
        with np.errstate(divide="ignore"):
            return np.asarray((2 * np.pi * self.frequency / self.deflection_at(position)) ** 2)
