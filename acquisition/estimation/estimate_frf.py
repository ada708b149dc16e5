"""Estimate the averaged FRF of hits, its running mean and its errors from force noise."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from acquisition.arrays import Complexes, Flags, Floats
from acquisition.frf import Frf, from_accelerance
from acquisition.hit import Hit
from acquisition.hits.force_window import window_force

Estimator = Literal["H1", "H2", "Hv"]

Spectra = tuple[Floats, Floats, Complexes]

EXCITATION_FLOOR = np.finfo(np.float64).eps ** 2
"""Share of the largest force power up to which a line holds only rounding; with few codes it can be exactly 0."""


def estimate_frf(hits: Sequence[Hit], estimator: Estimator = "H1") -> Frf:
    """Estimate the averaged FRF of hits with coherence and usable band.

    H1 = S_fx / S_ff (noise on the response), H2 = S_xx / S_xf (noise on the force), and Hv is their geometric mean with
    the phase of S_fx, where S_fx is the mean of conj(F) X. The response window is rectangular. The force is tapered to
    zero around each touch of the hammer, which keeps its noise out. Lines without excitation have receptance 0 and
    coherence 0.

    Parameters
    ----------
    hits
        Hits of the same sample rate and length.
    estimator
        "H1", "H2" or "Hv".

    Returns
    -------
    Frf
        Receptance (m/N) without the line at 0 Hz.

    Raises
    ------
    ValueError
        For no hits, hits of different length or rate, and hits without a pulse.

    References
    ----------
    ISO 7626-5; Bendat & Piersol, Random Data, ch. 6.

    Examples
    --------
    >>> time = np.arange(-100, 4000) / 10240.0
    >>> force = 200 * np.where((time >= 0) & (time <= 1e-3), np.sin(np.pi * time / 1e-3) ** 4, 0.0)  # N
    >>> structure = Structure(np.array([500.0]), np.array([0.02]), np.array([2e7]))
    >>> hit = Hit(force, 200 * structure.response(time, 1e-3), 10240.0, pre_trigger=100)
    >>> frf = estimate_frf([hit])
    >>> peak = abs(frf.in_band((300.0, 700.0)).receptance).max()
    >>> round(float(peak) * 1e6, 2), 1 / (2 * 0.02 * 2e7) * 1e6  # um/N; 1 / (2 zeta K)
    (1.25, 1.25)
    """
    if estimator not in get_args(Estimator):
        raise ValueError(f"estimator={estimator!r} is not one of {', '.join(get_args(Estimator))}")
    return estimate_frf_from_spectra(compute_cross_spectra(hits), hits, estimator)


def estimate_frf_from_spectra(spectra: Spectra, hits: Sequence[Hit], estimator: Estimator = "H1") -> Frf:
    """Estimate the FRF from the mean, or the sum, of the spectra of these hits."""
    s_ff, s_xx, s_fx = spectra
    excited = s_ff > EXCITATION_FLOOR * np.max(s_ff)
    forms: dict[Estimator, Callable[[], Complexes]] = {
        "H1": lambda: s_fx * _divide_where_excited(np.ones_like(s_ff), s_ff, excited),
        "H2": lambda: _divide_where_excited(s_xx * s_fx, np.abs(s_fx) ** 2, excited),
        "Hv": lambda: np.sqrt(_divide_where_excited(s_xx, s_ff, excited)) * np.exp(1j * np.angle(s_fx)),
    }
    frequency = np.fft.rfftfreq(hits[0].force.size, 1 / hits[0].sample_rate)
    shares = _divide_where_excited(np.abs(s_fx) ** 2, s_ff * s_xx, excited) if len(hits) > 1 else None
    coherence = None if shares is None else np.minimum(shares, 1.0)
    return from_accelerance(frequency, forms[estimator](), coherence, len(hits), find_usable_band(frequency, s_ff))


def _divide_where_excited(dividend: NDArray[Any], power: Floats, excited: Flags) -> NDArray[Any]:
    """Divide at excited lines with any power; 0 elsewhere."""
    divided = excited & (power > 0)
    if divided.all():  # without a mask in half the time
        return np.asarray(dividend / power)
    return np.asarray(np.divide(dividend, power, out=np.zeros_like(dividend), where=divided))


def compute_cross_spectra(hits: Sequence[Hit]) -> Spectra:
    """Compute the mean auto-spectra and the mean cross-spectrum of hits.

    Parameters
    ----------
    hits
        Hits of the same sample rate and length.

    Returns
    -------
    s_ff : ndarray, shape (n // 2 + 1,)
        Auto-spectrum of the force (N^2), tapered to zero around each touch.
    s_xx : ndarray, shape (n // 2 + 1,)
        Auto-spectrum of the response ((m/s^2)^2).
    s_fx : ndarray, shape (n // 2 + 1,)
        Cross-spectrum, the mean of conj(F) X (N m/s^2).

    Raises
    ------
    ValueError
        As for `estimate_frf`.

    References
    ----------
    Bendat & Piersol, Random Data, ch. 6.

    Examples
    --------
    >>> force = np.zeros(1000)
    >>> force[100:110] = 200.0  # N
    >>> s_ff, s_xx, s_fx = compute_cross_spectra([Hit(force, force / 2.0, 10000.0, pre_trigger=100)])  # mass of 2 kg
    >>> round(float((s_fx[10] / s_ff[10]).real), 6)  # 1/kg
    0.5
    """
    if not hits:
        raise ValueError("0 hits cannot be averaged")
    shapes = {(hit.force.size, hit.sample_rate) for hit in hits}
    if len(shapes) > 1:
        found = f"hits differ in length or sample rate: {sorted(shapes)}"
        raise ValueError(f"{found}. Average only hits with the same record length and sample rate.")
    n = hits[0].force.size
    records = np.zeros((2, n))
    spectra = np.empty((2, n // 2 + 1), np.complex128)
    parts = spectra.view(np.float64)
    s_fx, product, powers = np.zeros_like(spectra[0]), np.empty_like(spectra[0]), np.zeros_like(parts)
    for hit in hits:  # one at a time: ten hits at once are ten times the cache of a processor
        part = window_force(hit)
        backwards = -part.samples
        records[0, backwards] = part.force  # in time: its spectrum is conj(F)
        records[1] = hit.acceleration
        np.fft.rfft(records, out=spectra)
        records[0, backwards] = 0.0
        s_fx += np.multiply(spectra[0], spectra[1], out=product)
        powers += np.square(parts, out=parts)
    channels = hits[0].channels
    skew = channels[1].skew - channels[0].skew if channels else 0.0  # delay of the response (s)
    if skew:
        s_fx *= np.exp(-2j * np.pi * np.fft.rfftfreq(n, 1 / hits[0].sample_rate) * skew)
    s_ff, s_xx = (powers[:, ::2] + powers[:, 1::2]) / len(hits)
    return s_ff, s_xx, s_fx * (1 / len(hits))


def find_usable_band(frequency: NDArray[np.floating[Any]], s_ff: Floats) -> tuple[float, float]:
    """Return the band from the first line to the first one with a force spectrum 20 dB below its largest value."""
    weak = np.flatnonzero(s_ff[1:] < 0.01 * np.max(s_ff[1:]))
    return float(frequency[1]), float(frequency[weak[0] if weak.size else -1])


MIN_CONVERGED_HITS = 4
"""Smallest number of hits of a converged mean."""
MAX_CONVERGED_ERROR = 0.005
"""Standard error of |H| near the highest peak below which the mean has converged (-)."""
NEAR_PEAK_SHARE = 0.5
"""Share of the largest |accelerance| in the usable band from which a line is near the peak."""


class RunningMean:
    """Running H1 mean of hits of one set-up; of hits without a force, only the hits.

    Examples
    --------
    >>> time = np.arange(-100, 4000) / 10240.0
    >>> pulse = np.where((time >= 0) & (time <= 1e-3), np.sin(np.pi * time / 1e-3) ** 4, 0.0)
    >>> response = Structure(np.array([500.0]), np.array([0.02]), np.array([2e7])).response(time, 1e-3)
    >>> mean, random = RunningMean(), np.random.default_rng(1)
    >>> for force in (180.0, 200.0, 220.0, 240.0, 260.0):
    ...     mean.add(Hit(force * pulse, force * response + random.normal(0.0, 2.0, time.size), 10240.0, 100))
    >>> mean.has_converged, f"{100 * mean.peak_error:.1f} %"
    (True, '0.5 %')
    """

    def __init__(self) -> None:
        self.hits: tuple[Hit, ...] = ()
        """Hits of the mean, in the order they were added."""
        self.frf: Frf | None = None
        """H1 with coherence and usable band, as estimate_frf gives it for the same hits; None if there is none."""
        self._sums: Spectra | None = None
        self._before: Frf | None = None

    @property
    def relative_change(self) -> float | None:
        """Change of the mean by the last hit (-); None below 2 hits.

        Rms of the difference of the accelerance with and without it over the rms of the accelerance, in the usable
        band.
        """
        if self.frf is None or self._before is None:
            return None
        inside = _is_in_usable_band(self.frf)
        now, before = (frf.accelerance[inside] for frf in (self.frf, self._before))
        return float(np.linalg.norm(now - before) / np.linalg.norm(now))

    @property
    def has_converged(self) -> bool:
        """True if more hits would hardly change the peak.

        There are at least MIN_CONVERGED_HITS hits, and the rms of the random error sqrt((1 - g2) / (2 n g2)) over the
        lines near the highest peak is below MAX_CONVERGED_ERROR.
        """
        return len(self.hits) >= MIN_CONVERGED_HITS and self.peak_error < MAX_CONVERGED_ERROR

    @property
    def peak_error(self) -> float:
        """Standard error of |H| near the highest peak (-); inf below 3 hits, where the coherence has no meaning."""
        frf = self.frf
        if frf is None or frf.random_error is None:
            return float("inf")
        size = np.abs(frf.accelerance) * _is_in_usable_band(frf)
        near = size >= NEAR_PEAK_SHARE * np.max(size)
        return float(np.sqrt(np.mean(frf.random_error[near] ** 2)))

    def add(self, hit: Hit) -> None:
        """Add a good hit.

        Parameters
        ----------
        hit
            Hit with a pulse, of the length and the sample rate of the others.

        Raises
        ------
        ValueError
            If the hit has no pulse, or another length or rate.
        """
        size = hit.acceleration.size
        if self.hits and (size, hit.sample_rate) != (self.hits[0].acceleration.size, self.hits[0].sample_rate):
            mean = f"{self.hits[0].acceleration.size} samples at {self.hits[0].sample_rate:g} Hz"
            found = f"a hit of {size} samples at {hit.sample_rate:g} Hz cannot be averaged with hits of {mean}"
            raise ValueError(f"{found}. Start a new tap test.")
        if not hit.has_force:
            self.hits = (*self.hits, hit)
            return
        spectra = compute_cross_spectra([hit])
        sums, hits = self._sums, (*self.hits, hit)
        sums = spectra if sums is None else (sums[0] + spectra[0], sums[1] + spectra[1], sums[2] + spectra[2])
        self._before, self.frf = self.frf, estimate_frf_from_spectra(sums, hits)
        self._sums, self.hits = sums, hits

    def remove(self, hit: Hit) -> None:
        """Take a hit out of the mean.

        Parameters
        ----------
        hit
            Hit of the mean.

        Raises
        ------
        ValueError
            If the hit is not in the mean.
        """
        kept = self._others(hit)
        self.hits, self.frf, self._sums = (), None, None
        for remaining in kept:  # a subtraction would leave its rounding errors
            self.add(remaining)

    def _others(self, hit: Hit) -> list[Hit]:
        kept = [counted for counted in self.hits if counted is not hit]
        if len(kept) == len(self.hits):
            raise ValueError("this hit is not in the mean, so it cannot be removed")
        return kept


def _is_in_usable_band(frf: Frf) -> Flags:
    low, high = frf.usable_band or (0.0, np.inf)
    return np.asarray((frf.frequency >= low) & (frf.frequency <= high))


def propagate_force_noise(hits: Sequence[Hit], frequency: Floats) -> Iterator[Complexes]:
    """Propagate the noise of the hammer into H1, as shares of H1.

    To first order, one standard deviation of the noise at sample t of hit i changes H1 by

        -sigma_i w_i(t) conj(F_i) exp(-2 pi j f t) / sum_k |F_k|^2

    where F_i(f) is the spectrum of the windowed force, w_i the window, and sigma_i the rms of the baseline with white
    noise.

    Parameters
    ----------
    hits
        Hits of the mean.
    frequency : ndarray, shape (n,)
        Lines of H1 (Hz).

    Yields
    ------
    ndarray, shape (n, samples + 1)
        For each hit the errors of the samples in its force window. The last column is that of the mean of the baseline,
        which is subtracted from all samples. Each column has an independent real factor of variance one, and is smooth
        over lines closer than one over the window's length.

    Raises
    ------
    ValueError
        For a hit without a pulse.

    References
    ----------
    H1 of `estimate_frf` with F + N for F, expanded in N.
    """
    yield from propagate_force_noise_through(np.eye(frequency.size), hits, frequency)


def propagate_force_noise_through(
    rows: Complexes | Floats, hits: Sequence[Hit], frequency: Floats
) -> Iterator[Complexes]:
    """Yield linear maps (k, n) of each array of `propagate_force_noise`, shape (k, samples + 1), without that array."""
    parts = [window_force(hit) for hit in hits]
    delays = [part.samples - part.samples[0] for part in parts]
    used = np.unique(np.concatenate(delays))
    waves = np.exp(-2j * np.pi * np.outer(frequency, used / hits[0].sample_rate))
    columns = [np.searchsorted(used, delay) for delay in delays]
    spectra = [waves[:, column] @ part.force for column, part in zip(columns, parts, strict=True)]
    power = np.sum(np.abs(spectra) ** 2, axis=0)
    for part, spectrum, column in zip(parts, spectra, columns, strict=True):
        response = (rows * (np.conj(spectrum) / power)) @ waves[:, column]
        yield np.column_stack((response * (-part.noise * part.window), response @ (part.mean_noise * part.window)))
