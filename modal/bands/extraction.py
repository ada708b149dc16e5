"""What an extraction of modes found."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from acquisition import Frf, recorded_share
from modal.bands.find_resonances import Resonance
from modal.fitting import BandFit
from modal.poles import StabilisationChart, stabilise

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

HELD = "held"
"""Word for a mode whose frequency and damping ratio a person gave."""
ORDERS = 10
"""Highest order of the LSCF models of a band, several times the modes that one holds."""


@dataclass(frozen=True, eq=False)
class BandLines:
    """The lines of a band, and what is to be fitted to them."""

    lines: slice
    """Place on the frequency axis."""
    axis: Array
    """All frequencies of the FRFs (Hz), shape (n,)."""
    weight: Array
    """Weights of each FRF, shape (p, lines)."""
    own: ComplexArray
    """The receptances without the modes of all other bands (m/N), shape (p, lines)."""

    @property
    def frequency(self) -> Array:
        """Frequencies of the lines (Hz), shape (lines,)."""
        return self.axis[self.lines]

    @cached_property
    def chart(self) -> StabilisationChart:
        """LSCF poles of these lines."""
        return stabilise(self.frequency, self.own, self.weight, ORDERS)


@dataclass(frozen=True, eq=False)
class FittedBand:
    """Some neighbouring modes that were fitted together."""

    data: BandLines
    """Lines and receptances that they were fitted to."""
    resonances: tuple[Resonance, ...]
    """The peaks that the band was laid around."""
    height: Array
    """Mobility that the one of each mode is measured against, its own peak or the highest of the band (m/s/N), (m,)."""
    fit: BandFit
    """Their values."""
    terms: int
    """Complex residual terms in each FRF."""
    suspects: tuple[float, ...] = ()
    """Frequencies of modes that may stand here instead of those fitted, but are too uncertain (Hz)."""
    by_hand: tuple[str, ...] = ()
    """Word for what a person did to each mode, "" for nothing; empty where nobody chose modes of this band."""

    @property
    def lines(self) -> slice:
        """Where on the frequency axis."""
        return self.data.lines

    @cached_property
    def receptance(self) -> ComplexArray:
        """Of its modes alone on all lines of the FRFs (m/N), shape (p, n)."""
        return self.fit.receptance(self.data.axis)


@dataclass(frozen=True, eq=False)
class Extraction:
    """All that was found in one FRF, or in p of them with the same poles."""

    frfs: tuple[Frf, ...]
    """The lines that were used, the same of each; the driving point first."""
    weight: Array
    """Their weights, shape (p, n)."""
    bands: tuple[FittedBand, ...]
    """Bands by rising frequency."""

    @property
    def frf(self) -> Frf:
        """The driving point: the FRF that stiffnesses belong to."""
        return self.frfs[0]

    @cached_property
    def record(self) -> float | None:
        """Length of the record that the lines are of (s), without zeros behind it; None for an uneven axis."""
        steps = np.diff(self.frf.frequency)
        even = np.ptp(steps) < 1e-3 * steps[0]
        return float(recorded_share(self.frf) / np.mean(steps)) if even else None

    @property
    def receptance(self) -> ComplexArray:
        """Of all modes found on all lines (m/N), shape (p, n)."""
        return self._tails(slice(None), None)

    def data(self, lines: slice, without: FittedBand | None = None) -> BandLines:
        """What is left on some lines when the modes of all bands but one are taken off."""
        measured = np.array([frf.receptance[lines] for frf in self.frfs])
        return BandLines(lines, self.frf.frequency, self.weight[:, lines], measured - self._tails(lines, without))

    def _tails(self, lines: slice, without: FittedBand | None) -> ComplexArray:
        """Of all modes but those of one band, on these lines (m/N), shape (p, lines)."""
        parts = [band.receptance[:, lines] for band in self.bands if band is not without]
        none = np.zeros((len(self.frfs), self.frf.frequency[lines].size), complex)
        return np.asarray(sum(parts, none))

    def left(self, band: FittedBand) -> ComplexArray:
        """Measured receptances on the lines of a band less the fit with its residual terms (m/N), shape (p, lines).

        0 at stray lines.
        """
        weight = self.weight[:, band.lines]
        return np.asarray(band.fit.complex_residual / np.where(weight > 0, weight, np.inf))
