"""The frequency response function (FRF) and its three forms."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike

from acquisition.arrays import Complexes, Floats
from acquisition.hit import MAX_SI_VALUE, describe_invalid_value

FrfQuantity = Literal["receptance", "mobility", "accelerance"]
FRF_UNITS: dict[FrfQuantity, str] = {"receptance": "m/N", "mobility": "m/s/N", "accelerance": "m/s^2/N"}
"""Unit of each form of an FRF."""


class FrfPoints(NamedTuple):
    """Points of an FRF: node numbers, and directions as +-1 x, +-2 y, +-3 z, 0 if unknown."""

    response_node: int
    """Node of the sensor."""
    response_direction: int
    """Direction of the sensor."""
    hit_node: int
    """Node of the hammer."""
    hit_direction: int
    """Direction of the hammer."""


@dataclass(frozen=True, eq=False)
class Frf:
    """One averaged frequency response function, displacement over force.

    Raises
    ------
    ValueError
        If shapes differ, the frequency axis does not rise, or a value is not finite or beyond 1e50.

    Examples
    --------
    FRF of a rigid mass of 2 kg, 1 / (m w^2) with the opposite sign:

    >>> line = np.array([100.0, 200.0])  # Hz
    >>> frf = Frf(line, -1 / (2.0 * (2 * np.pi * line) ** 2) + 0j, coherence=np.array([0.9, 0.99]), n_averages=10)
    >>> frf.accelerance.real.round(6).tolist()  # 1/kg
    [0.5, 0.5]
    >>> frf.random_error.round(4).tolist()  # sqrt((1 - g2) / (2 n g2))
    [0.0745, 0.0225]
    """

    frequency: Floats
    """Frequency lines, rising, >= 0 (Hz), shape (n,)."""
    receptance: Complexes
    """Displacement over force (m/N), shape (n,)."""
    coherence: Floats | None = None
    """Ordinary coherence, 0 to 1, shape (n,); None if unknown."""
    n_averages: int = 1
    """Number of hits averaged."""
    measured_as: FrfQuantity = "receptance"
    """Quantity that the sensors measured, in which the noise is flat."""
    usable_band: tuple[float, float] | None = None
    """Contiguous band where the force spectrum is within 20 dB of its largest value (Hz)."""
    mass_removed: float = 0.0
    """Mass of the sensor that was removed from the FRF (kg)."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "frequency", np.asarray(self.frequency, dtype=np.float64))
        object.__setattr__(self, "receptance", np.asarray(self.receptance, dtype=np.complex128))
        if self.coherence is not None:
            object.__setattr__(self, "coherence", np.asarray(self.coherence, dtype=np.float64))
        self._check_axis()
        self._check_values()

    def _check_axis(self) -> None:
        f = self.frequency
        if f.ndim != 1 or f.size < 2:
            raise ValueError(f"frequency must be a 1-D array of at least 2 lines (Hz), not of shape {f.shape}")
        if not (f[0] >= 0 and f[-1] < math.inf and np.all(f[1:] > f[:-1])):
            raise ValueError("frequency must be finite, at least 0 Hz and strictly increasing")
        if self.measured_as not in get_args(FrfQuantity):
            raise ValueError(f"measured_as={self.measured_as!r} is not one of {', '.join(get_args(FrfQuantity))}")
        if self.n_averages < 1:
            raise ValueError(f"n_averages={self.n_averages} is below 1")

    def _check_values(self) -> None:
        if self.receptance.shape != self.frequency.shape:
            raise ValueError(f"receptance {self.receptance.shape} and frequency {self.frequency.shape} differ in shape")
        bad = np.flatnonzero(~(np.abs(self.receptance) <= MAX_SI_VALUE))
        if bad.size:
            flaw, first = describe_invalid_value(self.receptance[bad[0]]), f"first at {self.frequency[bad[0]]:g} Hz"
            raise ValueError(f"receptance is {flaw} at {bad.size} lines, {first}")
        if self.coherence is None:
            return
        if self.coherence.shape != self.frequency.shape:
            raise ValueError(f"coherence {self.coherence.shape} and frequency {self.frequency.shape} differ in shape")
        if not 0 <= self.coherence.min() <= self.coherence.max() <= 1 + 1e-9:
            raise ValueError("coherence must be between 0 and 1")

    @property
    def mobility(self) -> Complexes:
        """Velocity over force (m/s/N), shape (n,)."""
        return 2j * np.pi * self.frequency * self.receptance

    @property
    def accelerance(self) -> Complexes:
        """Acceleration over force (m/s^2/N), shape (n,)."""
        return -((2 * np.pi * self.frequency) ** 2) * self.receptance

    @property
    def has_random_error(self) -> bool:
        """True if there are a coherence and at least three averages."""
        return self.coherence is not None and self.n_averages >= 3

    @property
    def random_error(self) -> Floats | None:
        """Normalised random error of |H|, sqrt((1 - g2)/(2 n g2)), shape (n,); None below three averages.

        Source: Bendat & Piersol, Random Data, H1 estimate. The coherence of one or two hits has no meaning.
        """
        if self.coherence is None or not self.has_random_error:
            return None
        g2 = np.clip(self.coherence, 1e-12, 1.0)
        return np.sqrt((1 - g2) / (2 * self.n_averages * g2))

    def in_band(self, band: tuple[float, float] | None) -> Frf:
        """Return the lines inside a band.

        Parameters
        ----------
        band
            Lowest and highest frequency (Hz), included; None for all lines.

        Raises
        ------
        ValueError
            If the band holds fewer than 2 lines.
        """
        if band is None:
            return self
        low, high = band
        keep = (self.frequency >= low) & (self.frequency <= high)
        if not low < high or keep.sum() < 2:
            found = f"band {low:g}..{high:g} Hz contains {keep.sum()} lines of the FRF"
            span = f"{self.frequency[0]:g}..{self.frequency[-1]:g} Hz"
            raise ValueError(f"{found}. Choose a wider band within {span}.")
        coherence = None if self.coherence is None else self.coherence[keep]
        return replace(self, frequency=self.frequency[keep], receptance=self.receptance[keep], coherence=coherence)


def from_accelerance(
    frequency: ArrayLike,
    accelerance: ArrayLike,
    coherence: ArrayLike | None = None,
    n_averages: int = 1,
    usable_band: tuple[float, float] | None = None,
) -> Frf:
    """Return the FRF of an acceleration over force, divided by -(2 pi f)^2; a line at 0 Hz is left out.

    Parameters
    ----------
    frequency : array_like, shape (n,)
        Frequency lines (Hz).
    accelerance : array_like, shape (n,)
        Acceleration over force (m/s^2/N).
    coherence : array_like, shape (n,)
        Ordinary coherence; None if unknown.
    n_averages
        Number of averaged hits.
    usable_band
        Band with enough force (Hz).

    Returns
    -------
    Frf
        Receptance, with `measured_as` "accelerance".

    Raises
    ------
    ValueError
        As for `Frf`.

    Examples
    --------
    >>> frf = from_accelerance([0.0, 100.0, 200.0], [0.5, 0.5, 0.5])  # 1/kg: a mass of 2 kg
    >>> frf.frequency.tolist(), round(float(frf.receptance[0].real) * 1e6, 3)  # Hz, um/N
    ([100.0, 200.0], -1.267)
    >>> round(-0.5 / (2 * np.pi * 100.0) ** 2 * 1e6, 3)
    -1.267
    """
    f = np.asarray(frequency, dtype=np.float64)
    keep = slice(1 if f.size and f.flat[0] == 0 else 0, None)
    receptance = np.asarray(accelerance, dtype=np.complex128)[keep] * (-1 / (2 * np.pi * f[keep]) ** 2)
    g2 = None if coherence is None else np.asarray(coherence, dtype=np.float64)[keep]
    return Frf(f[keep], receptance, g2, n_averages, "accelerance", usable_band)
