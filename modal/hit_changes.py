"""Find modes that change from hit to hit of one tap test: drift, two states, change with force, missing in some hits.

The averaged FRF hides such changes. A resonance that moves is smeared there, and looks wide and stiff.
"""

import enum
import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from acquisition import Frf, Hit, estimate_frf, extract_free_decay
from modal.arrays import Complexes, Flags, Floats
from modal.bands.find_resonances import MIN_FRF_LINES, Resonance, find_resonances
from modal.bands.frf_lines import usable_lines
from modal.fit_modes import decay_spectra

MIN_HITS_FOR_CHANGES = 4
"""Fewest hits in which changes are searched: two states of two hits each, or a line with two more hits than values."""
MIN_PEAK_SHARE = 0.1
"""Least receptance or mobility of a searched peak over that of the highest peak; chosen: a lower one limits no cut."""
MIN_SEARCHED_SHARE = 0.02
"""Least mobility of a searched peak over the highest mobility of the hit: 0.1 of its receptance at a fifth of f."""
LINK_HALF_WIDTHS = 3.0
"""Largest distance between peaks of one mode in two hits (half-power half-widths); chosen."""
MAX_STATE_DISTANCE = 0.05
"""Largest relative distance between two states of one mode whose peaks do not overlap; chosen."""
WINDOW_HALF_WIDTHS = 3.0
"""Reach of the fitted lines beyond the outermost peaks (half-power half-widths); chosen."""
MIN_WINDOW_LINES = 13
"""Fewest lines of a fit: three times its four complex unknowns, and one."""
GAUSS_NEWTON_STEPS = 8
"""Steps of a fit; it converges from two half-widths away in five."""
MAX_STEP_HALF_WIDTHS = 0.5
"""Largest step of a pole (half-power half-widths)."""
MAX_COMMON_START_EXCESS = 1.5
"""Largest residual power from the start that all hits share, over that from the peak of the hit."""
MAX_ABSENT_SHARE = 1 / 3
"""Largest modal constant of a mode that counts as missing in a hit, over that of the hits with the mode; chosen."""
AMPLITUDE_SIGMAS = 3.0
"""Standard errors added to a modal constant before it counts as missing."""
MIN_CHANGE_HALF_WIDTHS = 0.1
"""Least change of frequency that is reported (damping ratios); chosen: the peak of the mean is then 0.1 % lower."""
MIN_CHI_SQUARE = 25.0
"""Least reduction of chi-square by a change: five standard errors."""
MIN_EXPLAINED_SHARE = 0.8
"""Least share of the variance that a line over hit number or force explains; chosen."""
MIN_STATE_SHARE = 0.9
"""Least share of the variance that two states explain; chosen: a line over ten hits reaches 0.76."""


class HitChangeKind(enum.StrEnum):
    """Kind of change from hit to hit."""

    DRIFT = "drift"
    """Frequency rises or falls from hit to hit."""
    TWO_STATES = "two-states"
    """Frequency has two values."""
    FORCE = "force"
    """Frequency changes with the force of the hit."""
    SCATTER = "scatter"
    """Frequency differs from hit to hit in no order."""
    PARTIAL = "partial"
    """Mode is missing in some hits."""


@dataclass(frozen=True)
class HitChange:
    """Change of one mode over the hits of a tap test."""

    kind: HitChangeKind
    """Kind of change."""
    frequency: float
    """Mean natural frequency over the hits with the mode (Hz)."""
    damping_ratio: float
    """Median damping ratio over these hits (-)."""
    peak: float
    """Highest peak of receptance in a single hit (m/N); relative to an unknown force for free decays."""
    hits: tuple[int, ...]
    """Indices of the hits in the state with fewer hits, or of the hits with the mode; empty for other kinds."""
    n_hits: int
    """Number of hits of the test."""
    spread: float = 0.0
    """Distance between the outermost states (Hz), signed: of the last hit to the first one, or of the hardest to the
    softest."""
    spread_std: float = 0.0
    """Standard error of the spread (Hz)."""

    @property
    def relative_spread(self) -> float:
        """Absolute spread over the half-power half-width, in damping ratios (-); inf for a mode missing in some hits."""
        if self.kind is HitChangeKind.PARTIAL:
            return float("inf")
        return abs(self.spread) / (self.damping_ratio * self.frequency)

    @property
    def per_hit(self) -> float:
        """Spread of a drift per hit (Hz)."""
        return self.spread / (self.n_hits - 1)


@dataclass(frozen=True, eq=False)
class HitSpectrum:
    """FRF of one hit with its resonances."""

    frf: Frf
    """FRF of the hit, or the spectrum of its free decay."""
    resonances: tuple[Resonance, ...]
    """Resonances in the usable band; empty if they cannot be found."""
    force: float | None
    """Largest force (N); None if not measured."""


def analyse_hit(hit: Hit) -> HitSpectrum:
    """Return the FRF of one hit with its resonances, for `find_hit_changes`."""
    if hit.has_force:
        frf, force = estimate_frf([hit]), float(np.max(hit.force) - np.median(hit.force))
    else:
        (frf,), force = decay_spectra(extract_free_decay(hit), hit.sample_rate), None
    try:
        resonances = find_resonances(usable_lines(frf, None), MIN_SEARCHED_SHARE)
    except ValueError:
        resonances = []
    return HitSpectrum(frf, tuple(resonances), force)


def find_hit_changes(spectra: Sequence[HitSpectrum]) -> list[HitChange]:
    """Find the modes of a tap test that change from hit to hit, the most flexible one first.

    The peaks of single hits are joined to modes, and one mode with a linear background is fitted to the lines around
    them in each hit. So a resonance is found that the averaged FRF smears or splits. Its frequencies are compared with
    a constant, a line over hit number, a line over force, and two states, by weighted least squares.

    Parameters
    ----------
    spectra
        Accepted hits in the order they were taken.

    Returns
    -------
    list of HitChange
        Significant changes of at least a tenth of the damping ratio; empty for fewer than four hits.

    References
    ----------
    Golub & Pereyra (1973), SIAM J. Numer. Anal. 10, 413 (separable least squares); docs/modal.md.
    """
    if len(spectra) < MIN_HITS_FOR_CHANGES:
        return []
    modes = _join_peaks(spectra)
    centres = [mode.centre for mode in modes]
    changes = (_evaluate_mode(spectra, mode, [c for c in centres if c != mode.centre]) for mode in modes)
    return sorted(itertools.chain.from_iterable(changes), key=lambda change: -change.peak)


class _HitMode:
    """Peaks of one mode, at most one in each hit."""

    def __init__(self, peaks: dict[int, Resonance]) -> None:
        self.peaks = peaks

    @property
    def frequencies(self) -> list[float]:
        return [peak.frequency for peak in self.peaks.values()]

    @property
    def centre(self) -> float:
        return float(np.median(self.frequencies))

    @property
    def half_width(self) -> float:
        return float(np.median([peak.half_width for peak in self.peaks.values()]))

    def is_near(self, peak: Resonance) -> bool:
        reach = LINK_HALF_WIDTHS * max(peak.half_width, self.half_width)
        return min(abs(own - peak.frequency) for own in self.frequencies) <= reach

    def continues(self, other: "_HitMode") -> bool:
        """Return whether another mode can be a state of this one: no hit has both."""
        close = abs(self.centre - other.centre) <= MAX_STATE_DISTANCE * self.centre
        return close and not self.peaks.keys() & other.peaks.keys()


def _receptance(peak: Resonance) -> float:
    return peak.height / (2 * np.pi * peak.frequency)


def _join_peaks(spectra: Sequence[HitSpectrum]) -> list[_HitMode]:
    """Join the peaks of single hits to modes, from the highest receptance down."""
    peaks = [(k, peak) for k, spectrum in enumerate(spectra) for peak in spectrum.resonances]
    peaks.sort(key=lambda numbered: -_receptance(numbered[1]))
    sizes = np.array([(_receptance(peak), peak.height) for _, peak in peaks]).reshape(-1, 2)
    is_high = np.any(sizes >= MIN_PEAK_SHARE * np.max(sizes, axis=0, initial=0.0), axis=1)
    free = [*itertools.compress(peaks, is_high)]
    modes: list[_HitMode] = []
    while free:
        mode = _HitMode(dict([free.pop(0)]))
        while near := [item for item in free if item[0] not in mode.peaks and mode.is_near(item[1])]:
            hit, peak = min(near, key=lambda item: abs(item[1].frequency - mode.centre))
            mode.peaks[hit] = peak
            free.remove((hit, peak))
        state = next((other for other in modes if other.continues(mode)), None)
        if state is None:
            modes.append(mode)
        else:
            state.peaks |= mode.peaks
    return modes


@dataclass(frozen=True, eq=False)
class _Window:
    """Lines around a mode in all hits."""

    x: Floats
    """Distance of the lines from the centre (half-widths), shape (lines,)."""
    accelerance: Complexes
    """Accelerance of each hit, shape (hits, lines)."""

    def columns(self, pole: Complexes) -> Complexes:
        """Return the columns 1/(x - pole), 1, x of each hit, shape (hits, lines, 3)."""
        ones = np.ones_like(self.accelerance)
        return np.stack([1 / (self.x - pole[:, np.newaxis]), ones, ones * self.x], axis=2)


@dataclass(frozen=True, eq=False)
class _PoleFit:
    """Pole and constant of one mode in each hit, with their errors."""

    pole: Complexes
    """Damped natural frequency, and half-width as imaginary part, from the centre (half-widths), shape (hits,)."""
    error: Floats
    """Standard error of the damped natural frequency (half-widths), shape (hits,)."""
    constant: Complexes
    """Modal constant, shape (hits,)."""
    residual: Floats
    """Sum of the squared residual, shape (hits,)."""


def _fit_poles(window: _Window, pole: Complexes) -> _PoleFit:
    """Fit constant/(x - pole) + background in each hit by Gauss-Newton, which is linear in the complex pole."""
    reach, start = np.ptp(window.x) / 2, pole
    for _ in range(GAUSS_NEWTON_STEPS):
        columns = window.columns(pole)
        values, _, _ = _solve(columns, window.accelerance)
        slope = values[:, :1] * columns[:, :, 0] ** 2
        values, residual, variance = _solve(np.concatenate([columns, slope[:, :, np.newaxis]], 2), window.accelerance)
        step = values[:, 3]
        step = step * np.minimum(1.0, MAX_STEP_HALF_WIDTHS / np.maximum(np.abs(step), 1e-30))
        pole = pole + step
        pole = np.clip(pole.real, -reach, reach) + 1j * np.clip(pole.imag, 0.1, reach)
    freedom = window.x.size - 4
    error = np.sqrt(residual / freedom * variance / 2) + np.abs(step)
    error = np.maximum(error, np.median(error))  # the noise of a few lines is known to a fifth only
    return _PoleFit(np.where(np.isfinite(error), pole, start), error, values[:, 0], residual)


def _solve(columns: Complexes, target: Complexes) -> tuple[Complexes, Floats, Floats]:
    """Return least-squares values, squared residuals, and the last diagonal element of the inverse normal matrix."""
    normal = np.swapaxes(columns.conj(), 1, 2) @ columns
    scale = np.sqrt(np.einsum("kii->ki", normal).real)
    inverse = np.linalg.pinv(normal / (scale[:, :, np.newaxis] * scale[:, np.newaxis]), hermitian=True)
    right = np.einsum("kli,kl->ki", columns.conj(), target) / scale
    values = np.einsum("kij,kj->ki", inverse, right) / scale
    residual = target - np.einsum("kli,ki->kl", columns, values)
    return values, np.sum(np.abs(residual) ** 2, axis=1), inverse[:, -1, -1].real / scale[:, -1] ** 2


def _cut_window(spectra: Sequence[HitSpectrum], mode: _HitMode, neighbours: Sequence[float]) -> _Window:
    """Cut the lines around all peaks of a mode, as far as the middle towards its neighbours."""
    f, width = spectra[0].frf.frequency, mode.half_width
    least, most = min(mode.frequencies), max(mode.frequencies)
    low = max([least - WINDOW_HALF_WIDTHS * width, *((least + n) / 2 for n in neighbours if n < least)])
    high = min([most + WINDOW_HALF_WIDTHS * width, *((most + n) / 2 for n in neighbours if n > most)])
    first, end = np.searchsorted(f, [min(low, least - width), max(high, most + width)])
    spare = max(0, MIN_WINDOW_LINES - int(end - first) + 1) // 2
    part = slice(max(int(first) - spare, 0), int(end) + spare)
    accelerance = np.array([spectrum.frf.accelerance[part] for spectrum in spectra])
    return _Window((f[part] - mode.centre) / width, accelerance)


def _fit_mode(window: _Window, mode: _HitMode) -> _PoleFit:
    """Fit the mode in each hit from the start that all hits share, unless the peak of the hit is clearly better.

    Of two close modes a hit may show only one peak, not always the same: that is no change.
    """
    own = np.full(window.accelerance.shape[0], 1j)
    for hit, peak in mode.peaks.items():
        own[hit] += (peak.frequency - mode.centre) / mode.half_width
    from_peaks, has_peak = _fit_poles(window, own), np.isin(np.arange(own.size), list(mode.peaks))
    near = from_peaks.pole[has_peak]
    shared = _fit_poles(window, np.full(own.size, np.median(near.real) + 1j * np.median(near.imag)))
    better = has_peak & (shared.residual > MAX_COMMON_START_EXCESS * from_peaks.residual)
    both = zip(vars(from_peaks).values(), vars(shared).values(), strict=True)
    return _PoleFit(*(np.where(better, first, second) for first, second in both))


def _evaluate_mode(spectra: Sequence[HitSpectrum], mode: _HitMode, neighbours: Sequence[float]) -> Iterator[HitChange]:
    """Yield the changes of one mode."""
    if len(mode.peaks) < 2 or spectra[0].frf.frequency.size < max(MIN_FRF_LINES, MIN_WINDOW_LINES):
        return
    window = _cut_window(spectra, mode, neighbours)
    fit = _fit_mode(window, mode)
    present, absent = _find_presence(window, mode, fit, spectra[0].force is not None)
    scale = mode.half_width
    f, error = mode.centre + scale * fit.pole.real, scale * fit.error
    damping = float(np.median(fit.pole.imag[present])) * scale / mode.centre
    shared = float(np.mean(f[present])), damping, max(map(_receptance, mode.peaks.values()))
    if np.count_nonzero(absent) > 1:
        yield HitChange(HitChangeKind.PARTIAL, *shared, tuple(np.flatnonzero(present).tolist()), len(spectra))
    used = np.flatnonzero(present & np.isfinite(error))
    if used.size >= MIN_HITS_FOR_CHANGES:
        change = _classify(used, f[used], error[used], _forces(spectra, used))
        if change is not None and abs(change.spread) >= MIN_CHANGE_HALF_WIDTHS * damping * shared[0]:
            yield HitChange(change.kind, *shared, change.hits, len(spectra), change.spread, change.spread_std)


def _forces(spectra: Sequence[HitSpectrum], used: Sequence[int]) -> Floats | None:
    forces = [spectra[k].force for k in used]
    return None if None in forces else np.array(forces, dtype=np.float64)


def _find_presence(window: _Window, mode: _HitMode, fit: _PoleFit, knows_size: bool) -> tuple[Flags, Flags]:
    """Return which hits have the mode, and which lack it beyond their noise.

    Without a force the sizes of two hits cannot be compared.
    """
    has_peak = np.isin(np.arange(fit.pole.size), list(mode.peaks))
    if not knows_size:
        return has_peak, np.zeros_like(has_peak)
    near = fit.pole[has_peak]
    pole = np.where(has_peak, fit.pole, np.median(near.real) + 1j * np.median(near.imag))
    columns = window.columns(pole)[:, :, [1, 2, 0]]
    values, residual, variance = _solve(columns, window.accelerance)
    size = np.abs(values[:, 2])
    noise = np.sqrt(residual / (window.x.size - 3) * variance)
    second_largest = float(np.sort(size[has_peak])[-2])
    absent = size + AMPLITUDE_SIGMAS * noise < MAX_ABSENT_SHARE * second_largest
    return ~absent & has_peak, absent


@dataclass(frozen=True)
class _Series:
    """Result of the comparison of the frequencies of one mode."""

    kind: HitChangeKind
    hits: tuple[int, ...]
    spread: float
    spread_std: float


def _classify(number: Floats, f: Floats, error: Floats, force: Floats | None) -> _Series | None:
    """Return how the frequencies change, shape (n,) each; None if they are constant within their errors."""
    weight = 1 / error**2
    total = _chi_square(np.ones((f.size, 1)), f, weight)[0]
    drift, states = _fit_slope(number, f, weight), _fit_states(f, weight)
    by_force = None if force is None or np.ptp(force) == 0 else _fit_slope(force, f, weight)
    lines = [(drift, HitChangeKind.DRIFT), (by_force, HitChangeKind.FORCE)]
    options = [(fit[0], kind, fit, MIN_EXPLAINED_SHARE, 2) for fit, kind in lines if fit is not None]
    if states is not None:
        options.append((states[0], HitChangeKind.TWO_STATES, states, MIN_STATE_SHARE, 3))
    fits = [option for option in options if _is_significant(total, option[0], option[3], f.size - option[4])]
    if fits:
        left, kind, (_, spread, std, hits), *_ = min(fits, key=lambda option: option[0] / (f.size - option[4]))
        return _Series(kind, tuple(number[hits].tolist()), spread, std)
    limit = MIN_CHI_SQUARE + scipy.special.chdtri(f.size - 1, 1e-3)
    if total < limit:
        return None
    return _Series(HitChangeKind.SCATTER, (), float(np.ptp(f)), float(np.sqrt(2) * np.median(error)))


def _is_significant(total: float, left: float, share: float, freedom: int) -> bool:
    """Return whether a change is beyond the errors, and explains its share or leaves no more than the errors."""
    explains = left <= (1 - share) * total or left <= 2 * freedom
    least = MIN_CHI_SQUARE * max(1.0, left / freedom) + (freedom if share == MIN_STATE_SHARE else 0)
    return total - left >= least and explains


_SeriesFit = tuple[float, float, float, Flags]


def _fit_slope(x: Floats, f: Floats, weight: Floats) -> _SeriesFit:
    """Return chi-square about a line, its change from the least x to the largest, and the error of that."""
    span = float(np.ptp(x))
    left, values, covariance = _chi_square(np.column_stack([np.ones(x.size), (x - np.min(x)) / span]), f, weight)
    inflated = max(1.0, left / (x.size - 2))
    return left, float(values[1]), float(np.sqrt(covariance[1, 1] * inflated)), np.zeros(x.size, dtype=bool)


def _fit_states(f: Floats, weight: Floats) -> _SeriesFit | None:
    """Return chi-square about the two best states of two hits or more, their distance, its error, the smaller state."""
    order = np.argsort(f)
    splits = []
    for size in range(2, f.size - 1):
        upper = np.zeros(f.size, dtype=bool)
        upper[order[size:]] = True
        splits.append((*_chi_square(np.column_stack([np.ones(f.size), upper]), f, weight), upper))
    left, values, covariance, upper = min(splits, key=lambda split: split[0])
    inflated = max(1.0, left / max(f.size - 3, 1))
    fewer = upper if np.count_nonzero(upper) <= f.size / 2 else ~upper
    return left, float(values[1]), float(np.sqrt(covariance[1, 1] * inflated)), fewer


def _chi_square(columns: Floats, f: Floats, weight: Floats) -> tuple[float, Floats, Floats]:
    """Return weighted chi-square, values and covariance of a linear fit."""
    inverse = np.linalg.inv(columns.T @ (columns * weight[:, np.newaxis]))
    middle = np.mean(f)
    values = inverse @ (columns.T @ (weight * (f - middle)))
    return float(np.sum(weight * (f - middle - columns @ values) ** 2)), values, inverse
