"""Find modes that change from hit to hit of one tap test: drift, two states, change with force, missing in some hits.

The averaged FRF hides such changes. A resonance that moves is smeared there, and looks wide and stiff.
"""

import itertools
import statistics
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from acquisition import Frf, Hit, estimate_frf, extract_free_decay
from modal.arrays import Complexes, Flags, Floats
from modal.bands.find_resonances import Resonance, find_resonances
from modal.bands.frf_lines import usable_lines
from modal.fit_modes import decay_spectra
from modal.frequency_series import HitChangeKind, find_frequency_change
from modal.hit_scatter import hit_peaks

MIN_HITS_FOR_CHANGES = 4
"""Fewest hits in which changes are searched: two states of two hits each, or a line with two more hits than values."""
MIN_HITS_WITH_MODE, MIN_HITS_WITHOUT_MODE = 2, 2
"""Fewest hits that have a mode, and that lack it, for a mode missing in some hits; chosen: one may be a slip."""
MIN_PEAK_SHARE = 0.1
"""Least receptance or mobility of a searched peak over that of the highest peak; chosen: a lower one limits no cut."""
MIN_SEARCHED_SHARE = 0.02
"""Least mobility of a searched peak over the highest mobility of the hit: 0.1 of its receptance at a fifth of f."""
LINK_HALF_WIDTHS = 3.0
"""Largest distance between peaks of one mode in two hits (half-power half-widths); chosen."""
MAX_STATE_DISTANCE = 0.1
"""Largest relative distance between two states of one mode whose peaks do not overlap; chosen."""
WINDOW_HALF_WIDTHS = 3.0
"""Reach of the fitted lines beyond the outermost peaks (half-power half-widths); chosen."""
MIN_WINDOW_LINES = 13
"""Fewest lines of a fit: three times its four complex unknowns, and one."""
GAUSS_NEWTON_STEPS = 8
"""Steps of a fit; it converges from two half-widths away in five."""
MAX_STEP_HALF_WIDTHS = 0.5
"""Largest step of a pole (half-power half-widths)."""
MAX_LAST_STEP = 1e-4
"""Largest step of a converged pole (half-power half-widths)."""
MAX_INVERSE = 1e12
"""Largest element of an inverse, of a matrix with diagonal 1; chosen: above it rounding (1e-16) leaves four digits."""
MIN_POLE_ERROR = 1e-6
"""Least standard error of a pole (half-power half-widths), of hits without noise; chosen."""
MAX_COMMON_START_EXCESS = 1.5
"""Largest residual power from the start that all hits share, over that from the peak of the hit."""
MAX_ABSENT_SHARE = 1 / 3
"""Largest modal constant of a mode that counts as missing in a hit, over that of the hits with the mode; chosen."""
ABSENCE_SIGMAS = 3.0
"""Standard errors added to a modal constant before it counts as missing."""
MIN_SPREAD = 0.1
"""Least change of frequency that is reported (damping ratios); chosen: the mean then loses 0.1 % of its peak."""


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
    n_hits: int
    """Number of hits of the test."""
    is_highest: bool
    """True for the mode with the highest peak of all."""
    hits: tuple[int, ...]
    """Indices of the hits in the state with fewer hits, or of the hits with the mode; empty for other kinds."""
    spread: float = 0.0
    """Distance between the outermost states (Hz), signed: of the last hit to the first one, or of the hardest to the
    softest."""
    spread_std: float = 0.0
    """Standard error of the spread (Hz)."""

    @property
    def relative_spread(self) -> float:
        """Absolute spread in damping ratios (-); inf for a mode missing in some hits."""
        if self.kind is HitChangeKind.PARTIAL:
            return float("inf")
        return abs(self.spread) / (self.damping_ratio * self.frequency)

    @property
    def per_hit(self) -> float:
        """Spread of a drift per hit (Hz)."""
        return self.spread / (self.n_hits - 1)


@dataclass(frozen=True, eq=False)
class _HitSpectrum:
    """FRF of one hit with its resonances."""

    frf: Frf
    """FRF of the hit, or the spectrum of its free decay, on the lines of the whole record."""
    resonances: tuple[Resonance, ...]
    """Resonances in the usable band; empty if they cannot be found."""
    force: float
    """Largest force (N); NaN if not measured."""


def find_hit_changes(hits: Sequence[Hit]) -> list[HitChange]:
    """Find the modes of a tap test that change from hit to hit, the most flexible one first.

    The peaks of single hits are joined to modes, and one mode with a linear background is fitted to the lines around
    them in each hit. So a resonance is found that the averaged FRF smears or splits. Its frequencies are compared with
    a constant, a line over hit number, a line over force, and two states, by weighted least squares. The spectrum of
    each hit is cached.

    Parameters
    ----------
    hits
        Accepted hits of one length in the order they were taken, with force or without.

    Returns
    -------
    list of HitChange
        Significant changes of at least a tenth of the damping ratio; empty for fewer than four hits.

    Raises
    ------
    ValueError
        For hits of different length or sample rate, and hits without a pulse.

    References
    ----------
    Golub & Pereyra (1973), SIAM J. Numer. Anal. 10, 413 (separable least squares); docs/modal.md.
    """
    if len(hits) < MIN_HITS_FOR_CHANGES:
        return []
    if len({(hit.acceleration.size, hit.sample_rate, hit.has_force) for hit in hits}) > 1:
        raise ValueError("hits differ in length, sample rate or sensors. Compare only hits of one tap test.")
    spectra = [_analyse_hit(hit) for hit in hits]
    modes = _join_peaks(spectra)
    changes = (_evaluate_mode(spectra, mode, [other for other in modes if other is not mode]) for mode in modes)
    found = itertools.chain.from_iterable(changes)
    return sorted(found, key=lambda change: (not change.is_highest, -change.peak))


def _analyse_hit(hit: Hit) -> _HitSpectrum:
    """Return the FRF of one hit with its resonances."""
    if hit not in _spectra:
        _spectra[hit] = _compute_spectrum(hit)
    return _spectra[hit]


_spectra: WeakKeyDictionary[Hit, _HitSpectrum] = WeakKeyDictionary()


def _compute_spectrum(hit: Hit) -> _HitSpectrum:
    if hit.has_force:
        frf, force = estimate_frf([hit]), float(hit_peaks([hit])[0])
    else:
        decay = extract_free_decay(hit)
        (frf,), force = decay_spectra(np.pad(decay, (0, hit.acceleration.size - decay.size)), hit.sample_rate), np.nan
    try:
        resonances = find_resonances(usable_lines(frf, None), MIN_SEARCHED_SHARE)
    except ValueError:
        resonances = []
    return _HitSpectrum(frf, tuple(resonances), force)


class _HitMode:
    """Peaks of one mode, at most one in each hit."""

    def __init__(self, peaks: dict[int, Resonance]) -> None:
        self.peaks = peaks

    @property
    def frequencies(self) -> list[float]:
        return [peak.frequency for peak in self.peaks.values()]

    @property
    def centre(self) -> float:
        return statistics.median(self.frequencies)

    @property
    def receptance(self) -> float:
        """Highest receptance of a peak (m/N)."""
        return max(map(_receptance, self.peaks.values()))

    def is_in(self, n_hits: int) -> Flags:
        """Return for each hit whether it has a peak of the mode, shape (n_hits,)."""
        return np.isin(np.arange(n_hits), list(self.peaks))

    @property
    def half_width(self) -> float:
        return statistics.median(peak.half_width for peak in self.peaks.values())

    def is_near(self, peak: Resonance) -> bool:
        reach = LINK_HALF_WIDTHS * max(peak.half_width, self.half_width)
        return min(abs(own - peak.frequency) for own in self.frequencies) <= reach

    def continues(self, other: "_HitMode") -> bool:
        """Return whether another mode can be a state of this one: no hit has both."""
        close = abs(self.centre - other.centre) <= MAX_STATE_DISTANCE * self.centre
        return close and not self.peaks.keys() & other.peaks.keys()


def _receptance(peak: Resonance) -> float:
    return peak.height / (2 * np.pi * peak.frequency)


def _join_peaks(spectra: Sequence[_HitSpectrum]) -> list[_HitMode]:
    """Join the peaks of single hits in their median usable band to modes, from the highest receptance down."""
    end = statistics.median(spectrum.frf.usable_band[1] if spectrum.frf.usable_band else np.inf for spectrum in spectra)
    numbered = [(k, peak) for k, spectrum in enumerate(spectra) for peak in spectrum.resonances]
    peaks = [(k, peak) for k, peak in numbered if peak.frequency + peak.half_width < end]
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
    """Accelerance of each hit up to a factor, shape (hits, lines)."""

    def columns(self, pole: Complexes) -> Complexes:
        """Return the columns 1/(x - pole), 1, x of each hit, shape (hits, lines, 3)."""
        ones = np.ones_like(self.accelerance)
        return np.stack([1 / (self.x - pole[:, np.newaxis]), ones, ones * self.x], axis=2)


@dataclass(frozen=True, eq=False)
class _PoleFit:
    """Pole of one mode in each hit."""

    pole: Complexes
    """Damped natural frequency, and half-width as imaginary part, from the centre (half-widths), shape (hits,)."""
    error: Floats
    """Standard error of the damped natural frequency (half-widths), shape (hits,)."""
    residual: Floats
    """Sum of the squared residual, shape (hits,)."""


def _fit_poles(window: _Window, pole: Complexes) -> _PoleFit:
    """Fit constant/(x - pole) + background in each hit by Gauss-Newton, which is linear in the complex pole."""
    reach = np.ptp(window.x) / 2
    for _ in range(GAUSS_NEWTON_STEPS):
        columns = window.columns(pole)
        values, _, _ = _solve(columns, window.accelerance)
        slope = values[:, :1] * columns[:, :, 0] ** 2
        values, residual, variance = _solve(np.concatenate([columns, slope[:, :, np.newaxis]], 2), window.accelerance)
        step = values[:, 3]
        if np.max(np.abs(step)) < MAX_LAST_STEP:
            break
        step = step * np.minimum(1.0, MAX_STEP_HALF_WIDTHS / np.maximum(np.abs(step), 1e-30))
        pole = pole + step
        pole = np.clip(pole.real, -reach, reach) + 1j * np.clip(pole.imag, 0.1, reach)
    freedom = window.x.size - 4
    error = np.maximum(np.sqrt(residual / freedom * variance / 2) + np.abs(step), MIN_POLE_ERROR)
    error = np.maximum(error, np.median(error))  # the noise of a few lines is known to a fifth only
    return _PoleFit(pole, error, residual)


def _solve(columns: Complexes, target: Complexes) -> tuple[Complexes, Floats, Floats]:
    """Return least-squares values, squared residuals, and the last diagonal element of the inverse normal matrix."""
    normal = np.swapaxes(columns.conj(), 1, 2) @ columns
    scale = np.sqrt(np.einsum("kii->ki", normal).real)
    scale[scale == 0] = 1.0
    inverse = _invert(normal / (scale[:, :, np.newaxis] * scale[:, np.newaxis]))
    right = np.einsum("kli,kl->ki", columns.conj(), target) / scale
    values = np.einsum("kij,kj->ki", inverse, right) / scale
    residual = target - np.einsum("kli,ki->kl", columns, values)
    return values, np.sum(np.abs(residual) ** 2, axis=1), inverse[:, -1, -1].real / scale[:, -1] ** 2


def _invert(normal: Complexes) -> Complexes:
    """Return the inverses of matrices, of those near singular the pseudo-inverses, which take ten times as long."""
    try:
        inverse = np.asarray(np.linalg.inv(normal))
    except np.linalg.LinAlgError:
        inverse = np.full_like(normal, np.inf)
    is_singular = np.max(np.abs(inverse), axis=(1, 2)) > MAX_INVERSE
    inverse[is_singular] = np.linalg.pinv(normal[is_singular], hermitian=True)
    return inverse


def _cut_window(spectra: Sequence[_HitSpectrum], mode: _HitMode, neighbours: Sequence[float]) -> _Window:
    """Cut the lines around all peaks of a mode, as far as the middle towards its neighbours."""
    f, width = spectra[0].frf.frequency, mode.half_width
    least, most = min(mode.frequencies), max(mode.frequencies)
    low = max([least - WINDOW_HALF_WIDTHS * width, *((least + n) / 2 for n in neighbours if n < least)])
    high = min([most + WINDOW_HALF_WIDTHS * width, *((most + n) / 2 for n in neighbours if n > most)])
    first, end = np.searchsorted(f, [min(low, least - width), max(high, most + width)])
    spare = max(0, MIN_WINDOW_LINES - int(end - first) + 1) // 2
    part = slice(max(int(first) - spare, 0), int(end) + spare)
    receptance: Complexes = np.array([spectrum.frf.receptance[part] for spectrum in spectra])
    return _Window((f[part] - mode.centre) / width, np.asarray(receptance * f[part] ** 2, np.complex128))


def _fit_mode(window: _Window, mode: _HitMode) -> _PoleFit:
    """Fit the mode in each hit from the start that all hits share, unless the peak of the hit is clearly better.

    Of two close modes a hit may show only one peak, not always the same: that is no change.
    """
    own = np.full(window.accelerance.shape[0], 1j)
    for hit, peak in mode.peaks.items():
        own[hit] += (peak.frequency - mode.centre) / mode.half_width
    from_peaks, has_peak = _fit_poles(window, own), mode.is_in(own.size)
    shared = _fit_poles(window, np.full(own.size, _median_pole(from_peaks.pole[has_peak])))
    better = has_peak & (shared.residual > MAX_COMMON_START_EXCESS * from_peaks.residual)
    both = zip(vars(from_peaks).values(), vars(shared).values(), strict=True)
    return _PoleFit(*(np.where(better, first, second) for first, second in both))


def _median_pole(pole: Complexes) -> complex:
    return complex(np.median(pole.real), np.median(pole.imag))


def _evaluate_mode(spectra: Sequence[_HitSpectrum], mode: _HitMode, others: Sequence[_HitMode]) -> Iterator[HitChange]:
    """Yield the changes of one mode."""
    if len(mode.peaks) < MIN_HITS_WITH_MODE:
        return
    window = _cut_window(spectra, mode, [other.centre for other in others])
    if window.x.size < MIN_WINDOW_LINES:
        return
    fit = _fit_mode(window, mode)
    has_mode = mode.is_in(len(spectra))
    present, absent = has_mode, np.zeros_like(has_mode)
    forces = np.array([spectrum.force for spectrum in spectra])
    knows_force = bool(np.all(np.isfinite(forces)))
    if knows_force:  # without it the sizes of two hits cannot be compared
        absent = _find_absent(window, fit, has_mode)
        present = has_mode & ~absent
    f = mode.centre + mode.half_width * fit.pole[present].real
    half_width = mode.half_width * float(np.median(fit.pole[present].imag))
    of_mode = float(np.mean(f)), half_width / mode.centre, mode.receptance
    of_test = len(spectra), all(mode.receptance >= other.receptance for other in others)
    if np.count_nonzero(absent) >= MIN_HITS_WITHOUT_MODE:
        yield HitChange(HitChangeKind.PARTIAL, *of_mode, *of_test, tuple(np.flatnonzero(present).tolist()))
    if f.size < max(MIN_HITS_FOR_CHANGES, len(spectra) / 2):
        return
    number = np.flatnonzero(present)
    force = forces[present] if knows_force else None
    change = find_frequency_change(number, f, mode.half_width * fit.error[present], force)
    if change is not None and abs(change.spread) >= MIN_SPREAD * half_width:
        state = tuple(number[change.smaller_state].tolist())
        yield HitChange(change.kind, *of_mode, *of_test, state, change.spread, change.spread_std)


def _find_absent(window: _Window, fit: _PoleFit, has_mode: Flags) -> Flags:
    """Return which hits lack a mode beyond their noise, shape (hits,)."""
    pole = np.where(has_mode, fit.pole, _median_pole(fit.pole[has_mode]))
    values, residual, variance = _solve(window.columns(pole)[:, :, ::-1], window.accelerance)
    size, noise = np.abs(values[:, 2]), np.sqrt(residual / (window.x.size - 3) * variance)
    second_largest = float(np.sort(size[has_mode])[-2])
    return np.asarray(size + ABSENCE_SIGMAS * noise < MAX_ABSENT_SHARE * second_largest)
