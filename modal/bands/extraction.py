"""Result of a modal extraction, and stabilisation charts of all its lines."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from acquisition import Frf, infer_recorded_share
from modal.arrays import Complexes, Floats
from modal.bands.find_resonances import Resonance
from modal.fitting import BandFit
from modal.poles import StabilisationChart, fit_lscf_poles, select_physical_poles

FIXED_MODE = "held"
"""Word for a mode whose frequency and damping ratio a person gave."""
MAX_LSCF_ORDER = 10
"""Highest order of the LSCF models of a band, several times the modes that one holds."""


@dataclass(frozen=True, eq=False)
class BandData:
    """The lines of a band, and what is to be fitted to them."""

    lines: slice
    """Place on the frequency axis."""
    axis: Floats
    """All frequencies of the FRFs (Hz), shape (n,)."""
    weight: Floats
    """Weights of each FRF, shape (p, lines)."""
    target: Complexes
    """The receptances without the modes of all other bands (m/N), shape (p, lines)."""

    @property
    def frequency(self) -> Floats:
        """Frequencies of the lines (Hz), shape (lines,)."""
        return self.axis[self.lines]

    @cached_property
    def chart(self) -> StabilisationChart:
        """LSCF poles of these lines."""
        return fit_lscf_poles(self.frequency, self.target, self.weight, MAX_LSCF_ORDER)


@dataclass(frozen=True, eq=False)
class FittedBand:
    """Some neighbouring modes that were fitted together."""

    data: BandData
    """Lines and receptances that they were fitted to."""
    resonances: tuple[Resonance, ...]
    """The peaks that the band was laid around."""
    height: Floats
    """Mobility that the one of each mode is measured against, its own peak or the highest of the band (m/s/N), (m,)."""
    fit: BandFit
    """Their values."""
    terms: int
    """Complex residual terms in each FRF."""
    close_frequencies: tuple[float, ...] = ()
    """Frequencies of modes that may stand here instead of those fitted, but are too uncertain (Hz)."""
    edits: tuple[str, ...] = ()
    """Word for what a person did to each mode, "" for nothing; empty where nobody chose modes of this band."""

    @property
    def lines(self) -> slice:
        """Where on the frequency axis."""
        return self.data.lines

    @cached_property
    def receptance(self) -> Complexes:
        """Of its modes alone on all lines of the FRFs (m/N), shape (p, n)."""
        return self.fit.receptance(self.data.axis)


@dataclass(frozen=True, eq=False)
class Extraction:
    """All that was found in one FRF, or in p of them with the same poles."""

    frfs: tuple[Frf, ...]
    """The lines that were used, the same of each; the driving point first."""
    weight: Floats
    """Their weights, shape (p, n)."""
    bands: tuple[FittedBand, ...]
    """Bands by rising frequency."""

    @property
    def frf(self) -> Frf:
        """The driving point: the FRF that stiffnesses belong to."""
        return self.frfs[0]

    @cached_property
    def record_length(self) -> float | None:
        """Length of the record that the lines are of (s), without zeros behind it; None for an uneven axis."""
        steps = np.diff(self.frf.frequency)
        even = np.ptp(steps) < 1e-3 * steps[0]
        return float(infer_recorded_share(self.frf) / np.mean(steps)) if even else None

    @property
    def receptance(self) -> Complexes:
        """Of all modes found on all lines (m/N), shape (p, n)."""
        return self._tails(slice(None), None)

    def data(self, lines: slice, without: FittedBand | None = None) -> BandData:
        """What is left on some lines when the modes of all bands but one are taken off."""
        measured = np.array([frf.receptance[lines] for frf in self.frfs])
        return BandData(lines, self.frf.frequency, self.weight[:, lines], measured - self._tails(lines, without))

    def _tails(self, lines: slice, without: FittedBand | None) -> Complexes:
        """Of all modes but those of one band, on these lines (m/N), shape (p, lines)."""
        parts = [band.receptance[:, lines] for band in self.bands if band is not without]
        none = np.zeros((len(self.frfs), self.frf.frequency[lines].size), complex)
        return np.asarray(sum(parts, none))

    def residual(self, band: FittedBand) -> Complexes:
        """Measured receptances on the lines of a band less the fit with its residual terms (m/N), shape (p, lines).

        0 at stray lines.
        """
        weight = self.weight[:, band.lines]
        return np.asarray(band.fit.complex_residual / np.where(weight > 0, weight, np.inf))


MAX_GAP_CHART_LINES = 200
"""Most lines of one chart between the bands, few enough for its order."""
FITTED_MODE_DISTANCE = 0.005
"""Relative distance up to which a pole beside a mode is that mode; chosen."""
MIN_CANDIDATE_SHARE = 0.05
"""Own peak of a pole, over the mobility measured there, from which it is worth a look; chosen."""
MIN_GAP_LINES = 16
"""Between bands that are nearer to each other than that there is nothing to look for."""


def stabilisation_charts(state: Extraction) -> list[StabilisationChart]:
    """Charts of the bands, and between them those of what the modes of all bands leave."""
    between = [state.data(lines).chart for lines in _gaps_between_bands(state)]
    return [*(band.data.chart for band in state.bands), *between]


def candidate_frequencies(state: Extraction) -> Floats:
    """Natural frequencies of the poles (Hz) that stay where they are as the order grows and are no modes, rising.

    Poles count whose own peak is a twentieth of what was measured there; one within the half-power half-width of a
    mode, or half a percent of it, is that mode.
    """
    modes = np.array([frequency for band in state.bands for frequency in band.fit.frequency])
    return np.sort([frequency for frequency, zeta in _visible_poles(state) if _is_unfitted(frequency, zeta, modes)])


def _visible_poles(state: Extraction) -> Iterator[tuple[float, float]]:
    """Frequency and damping ratio of each stable pole whose own peak is worth a share of what was measured there."""
    measured = np.max([np.abs(frf.mobility) for frf in state.frfs], axis=0)
    for poles in map(select_physical_poles, stabilisation_charts(state)):
        for frequency, zeta, largest in zip(poles.frequency, poles.damping_ratio, poles.largest, strict=True):
            there = measured[np.argmin(np.abs(state.frf.frequency - frequency))]
            if np.pi * frequency * largest / zeta > MIN_CANDIDATE_SHARE * there:
                yield float(frequency), float(zeta)


def _is_unfitted(frequency: float, zeta: float, modes: Floats) -> bool:
    return bool(np.min(np.abs(modes - frequency), initial=np.inf) > max(zeta, FITTED_MODE_DISTANCE) * frequency)


def _gaps_between_bands(state: Extraction) -> Iterator[slice]:
    """Lines outside all bands, in parts."""
    start = 0
    ends = [*((band.lines.start, band.lines.stop) for band in state.bands), (state.frf.frequency.size,) * 2]
    for stop, following in ends:
        if stop - start >= MIN_GAP_LINES:
            borders = np.linspace(start, stop, -(-(stop - start) // MAX_GAP_CHART_LINES) + 1).astype(int)
            yield from (slice(*pair) for pair in zip(borders[:-1].tolist(), borders[1:].tolist(), strict=True))
        start = max(start, following)
