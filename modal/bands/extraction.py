"""Result of a modal extraction, and stabilisation charts of all its lines."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from acquisition import Frf, infer_recorded_share
from modal.arrays import Complexes, Floats
from modal.bands.find_resonances import Resonance
from modal.fitting.band_fit import BandFit
from modal.poles import StabilisationChart, fit_lscf_poles, select_physical_poles

FIXED_MODE = "held"
"""Mark of a mode whose frequency and damping ratio were given."""
MAX_LSCF_ORDER = 10
"""Highest order of the LSCF models of a band, several times the number of its modes."""


@dataclass(frozen=True, eq=False)
class BandData:
    """Lines of a band and the receptances to be fitted."""

    lines: slice
    """Place on the frequency axis."""
    axis: Floats
    """Frequencies of the FRFs (Hz), shape (n,)."""
    weight: Floats
    """Weights of each FRF, shape (p, lines)."""
    target: Complexes
    """Receptances without the modes of all other bands (m/N), shape (p, lines)."""

    @property
    def frequency(self) -> Floats:
        """Frequencies of the lines (Hz), shape (lines,)."""
        return self.axis[self.lines]

    @cached_property
    def chart(self) -> StabilisationChart:
        """LSCF poles of these lines."""
        return fit_lscf_poles(self.frequency, self.target, self.weight, MAX_LSCF_ORDER)


@dataclass(frozen=True)
class MergedPair:
    """Two fitted modes that one mode replaced."""

    low: float
    """Lower natural frequency (Hz)."""
    high: float
    """Higher natural frequency (Hz)."""

    @property
    def spread(self) -> float:
        """Standard deviation of a mode that is at one of the two frequencies as often as at the other (Hz)."""
        return (self.high - self.low) / 2


@dataclass(frozen=True, eq=False)
class FittedBand:
    """Neighbouring modes that were fitted together."""

    data: BandData
    """Lines and receptances of the fit."""
    resonances: tuple[Resonance, ...]
    """Peaks that the band was laid around."""
    height: Floats
    """Reference mobility of each mode, its own peak or the highest of the band (m/s/N), shape (m,)."""
    fit: BandFit
    """Fitted modes."""
    terms: int
    """Number of complex residual terms in each FRF."""
    close_frequencies: tuple[float, ...] = ()
    """Frequencies of close modes that may replace the fitted ones but are too uncertain (Hz)."""
    edits: tuple[str, ...] = ()
    """Mark of what a person did to each mode, "" for nothing; empty if no mode was edited."""
    merged: tuple[MergedPair, ...] = ()
    """Pairs of modes that one of the fitted modes replaces each."""

    @property
    def lines(self) -> slice:
        """Lines of the band on the frequency axis."""
        return self.data.lines

    def merged_pair(self, i: int) -> MergedPair | None:
        """Return the widest pair that mode i replaces; None if it replaces none."""
        frequency, half_width = self.fit.frequency[i], np.prod(self.fit.poles[:, i])
        own = [pair for pair in self.merged if pair.low - half_width < frequency < pair.high + half_width]
        return max(own, key=lambda pair: pair.spread, default=None)

    def frequency_spread(self, i: int) -> float:
        """Return the standard deviation of the frequencies that mode i stands for, merged or suspected (Hz)."""
        pair, frequency = self.merged_pair(i), self.fit.frequency[i]
        near = [f for f in self.close_frequencies if abs(f - frequency) < frequency * self.fit.damping_ratio[i]]
        return float(np.ptp(near)) / 2 if near and pair is None else 0.0 if pair is None else pair.spread

    @cached_property
    def receptance(self) -> Complexes:
        """Receptance of these modes alone on all lines of the FRFs (m/N), shape (p, n)."""
        return self.fit.receptance(self.data.axis)


@dataclass(frozen=True, eq=False)
class Extraction:
    """Modes of one FRF, or of p FRFs with common poles."""

    frfs: tuple[Frf, ...]
    """Lines of each FRF that were used, the driving point first."""
    weight: Floats
    """Weights of the lines, shape (p, n)."""
    bands: tuple[FittedBand, ...]
    """Bands by rising frequency."""

    @property
    def frf(self) -> Frf:
        """FRF of the driving point, which the stiffnesses belong to."""
        return self.frfs[0]

    @cached_property
    def record_length(self) -> float | None:
        """Record length behind the lines (s), without appended zeros; None for an uneven axis."""
        steps = np.diff(self.frf.frequency)
        even = np.ptp(steps) < 1e-3 * steps[0]
        return float(infer_recorded_share(self.frf) / np.mean(steps)) if even else None

    @property
    def receptance(self) -> Complexes:
        """Receptance of all modes on all lines (m/N), shape (p, n)."""
        return self._tails(slice(None), None)

    def data(self, lines: slice, without: FittedBand | None = None) -> BandData:
        """Return some lines without the modes of all bands but one.

        Parameters
        ----------
        lines : slice
            Lines on the frequency axis.
        without : FittedBand, optional
            Band whose modes are not subtracted.

        Returns
        -------
        BandData
            Receptances that are left.
        """
        measured = np.array([frf.receptance[lines] for frf in self.frfs])
        return BandData(lines, self.frf.frequency, self.weight[:, lines], measured - self._tails(lines, without))

    def _tails(self, lines: slice, without: FittedBand | None) -> Complexes:
        """Return the receptance of all modes but those of one band on these lines (m/N), shape (p, lines)."""
        parts = [band.receptance[:, lines] for band in self.bands if band is not without]
        none = np.zeros((len(self.frfs), self.frf.frequency[lines].size), complex)
        return np.asarray(sum(parts, none))

    def residual(self, band: FittedBand) -> Complexes:
        """Return the measured receptances on the lines of a band less its fit and residual terms; 0 at stray lines.

        Parameters
        ----------
        band : FittedBand
            Band of this extraction.

        Returns
        -------
        ndarray, shape (p, lines)
            Residual (m/N).
        """
        weight = self.weight[:, band.lines]
        return np.asarray(band.fit.complex_residual / np.where(weight > 0, weight, np.inf))


def replace_band(state: Extraction, old: FittedBand | None, new: FittedBand | None) -> Extraction:
    """Replace a band, add a new one if `old` is None, or remove one if `new` is None."""
    if new is old:
        return state
    bands = [*(band for band in state.bands if band is not old), *([] if new is None else [new])]
    return replace(state, bands=tuple(sorted(bands, key=lambda band: band.lines.start)))


MAX_GAP_CHART_LINES = 200
"""Most lines of one chart between the bands, few enough for its order."""
FITTED_MODE_DISTANCE = 0.005
"""Relative distance up to which a pole near a fitted mode is that mode; chosen."""
MIN_CANDIDATE_SHARE = 0.05
"""Least peak of a candidate pole over the measured mobility; chosen."""
MIN_GAP_LINES = 16
"""Fewest lines of a gap between bands that is searched."""


def stabilisation_charts(state: Extraction) -> list[StabilisationChart]:
    """Return the stabilisation charts of all bands, and of the residual between the bands.

    Parameters
    ----------
    state : Extraction
        Extraction of one or several FRFs.

    Returns
    -------
    list of StabilisationChart
        Charts of the bands by rising frequency, then those of the gaps.
    """
    gaps = [state.data(lines) for lines in _gaps_between_bands(state)]
    return [data.chart for data in (*(band.data for band in state.bands), *gaps)]


def candidate_frequencies(state: Extraction) -> Floats:
    """Return the natural frequencies of stable poles that are not fitted as modes.

    A pole counts if its own peak is at least 5 % of the mobility measured there. A pole within the half-power
    half-width of a mode, or within 0.5 %, is that mode.

    Parameters
    ----------
    state : Extraction
        Extraction of one or several FRFs.

    Returns
    -------
    ndarray, shape (k,)
        Natural frequencies (Hz), rising.
    """
    modes = np.array([frequency for band in state.bands for frequency in band.fit.frequency])
    reach = ((f, max(zeta, FITTED_MODE_DISTANCE) * f) for f, zeta in _visible_poles(state))
    return np.sort([f for f, near in reach if np.min(np.abs(modes - f), initial=np.inf) > near])


def _visible_poles(state: Extraction) -> Iterator[tuple[float, float]]:
    """Yield frequency and damping ratio of each stable pole with a peak that is visible in the measured mobility."""
    measured = np.max([np.abs(frf.mobility) for frf in state.frfs], axis=0)
    for poles in map(select_physical_poles, stabilisation_charts(state)):
        for frequency, zeta, largest in zip(poles.frequency, poles.damping_ratio, poles.largest, strict=True):
            there = measured[np.argmin(np.abs(state.frf.frequency - frequency))]
            if np.pi * frequency * largest / zeta > MIN_CANDIDATE_SHARE * there:
                yield float(frequency), float(zeta)


def _gaps_between_bands(state: Extraction) -> Iterator[slice]:
    """Yield the lines outside all bands, in parts."""
    start = 0
    ends = [*((band.lines.start, band.lines.stop) for band in state.bands), (state.frf.frequency.size,) * 2]
    for stop, following in ends:
        if stop - start >= MIN_GAP_LINES:
            borders = np.linspace(start, stop, -(-(stop - start) // MAX_GAP_CHART_LINES) + 1).astype(int)
            yield from (slice(*pair) for pair in zip(borders[:-1].tolist(), borders[1:].tolist(), strict=True))
        start = max(start, following)
