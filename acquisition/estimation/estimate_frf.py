"""Averaged FRF from hammer hits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from acquisition.frf import Frf, from_accelerance
from acquisition.hit import Hit
from acquisition.hits.windowed_force import windowed_force

Estimator = Literal["H1", "H2", "Hv"]

Spectra = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.complex128]]

ROUNDING = np.finfo(np.float64).eps ** 2
"""Share of the largest force power at or below which a line holds rounding alone: of few codes it can be exactly 0."""


def estimate_frf(hits: Sequence[Hit], estimator: Estimator = "H1") -> Frf:
    """FRF of hits that share sample rate and length, with coherence and usable band.

    H1 = S_fx / S_ff (noise on the response), H2 = S_xx / S_xf (noise on the force), Hv their geometric mean with
    the phase of S_fx. S_fx = mean of conj(F) X. The response window is rectangular; the force is tapered to zero
    after its pulse, which keeps its noise out. Source: ISO 7626-5; Bendat & Piersol, Random Data, ch. 6.

    Lines that no hit excites, beyond the usable band, have receptance 0 and coherence 0.

    Raises ValueError for no hits, hits of different length or rate, and hits without a pulse.

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
        raise ValueError(f"estimator={estimator!r} is none of {', '.join(get_args(Estimator))}")
    return frf_of_spectra(cross_spectra(hits), hits, estimator)


def frf_of_spectra(spectra: Spectra, hits: Sequence[Hit], estimator: Estimator = "H1") -> Frf:
    """The same from the mean, or the sum, of the spectra of these hits."""
    s_ff, s_xx, s_fx = spectra
    excited = s_ff > ROUNDING * np.max(s_ff)
    forms: dict[Estimator, Callable[[], NDArray[np.complex128]]] = {
        "H1": lambda: s_fx * _quotient(np.ones_like(s_ff), s_ff, excited),
        "H2": lambda: _quotient(s_xx * s_fx, np.abs(s_fx) ** 2, excited),
        "Hv": lambda: np.sqrt(_quotient(s_xx, s_ff, excited)) * np.exp(1j * np.angle(s_fx)),
    }
    frequency = np.fft.rfftfreq(hits[0].force.size, 1 / hits[0].sample_rate)
    coherence = np.minimum(_quotient(np.abs(s_fx) ** 2, s_ff * s_xx, excited), 1.0) if len(hits) > 1 else None
    return from_accelerance(frequency, forms[estimator](), coherence, len(hits), usable_band(frequency, s_ff))


def _quotient(dividend: NDArray[Any], power: NDArray[np.float64], excited: NDArray[np.bool_]) -> NDArray[Any]:
    """dividend / power at excited lines with any, else 0."""
    return np.asarray(np.divide(dividend, power, out=np.zeros_like(dividend), where=excited & (power > 0)))


def cross_spectra(hits: Sequence[Hit]) -> Spectra:
    """Mean auto-spectra S_ff (N^2), S_xx ((m/s^2)^2) and cross-spectrum S_fx of the hits, each (n // 2 + 1,).

    S_fx (N m/s^2) is the mean of conj(F) X, F the force tapered to zero after its pulse. Raises ValueError as
    `estimate_frf`. Source: Bendat & Piersol, Random Data, ch. 6.

    >>> force = np.zeros(1000)
    >>> force[100:110] = 200.0  # N
    >>> s_ff, s_xx, s_fx = cross_spectra([Hit(force, force / 2.0, 10000.0, pre_trigger=100)])  # of a mass of 2 kg
    >>> round(float((s_fx[10] / s_ff[10]).real), 6)  # 1/kg
    0.5
    """
    if not hits:
        raise ValueError("there is no hit to average; at least one is needed")
    shapes = {(hit.force.size, hit.sample_rate) for hit in hits}
    if len(shapes) > 1:
        raise ValueError(f"hits differ in length or sample rate: {sorted(shapes)}; average only hits of one set-up")
    n = hits[0].force.size
    records = np.zeros((2, n))
    spectra = np.empty((2, n // 2 + 1), np.complex128)
    parts = spectra.view(np.float64)
    s_fx, powers = np.zeros_like(spectra[0]), np.zeros_like(parts)
    for hit in hits:  # one at a time: ten hits at once are ten times the cache of a processor
        part = windowed_force(hit)
        backwards = -np.arange(part.samples.start, part.samples.stop)
        records[0, backwards] = part.force  # in time: its spectrum is conj(F)
        records[1] = hit.acceleration
        np.fft.rfft(records, out=spectra)
        records[0, backwards] = 0.0
        s_fx += spectra[0] * spectra[1]
        powers += np.square(parts, out=parts)
    skew = _skew(hits[0])
    if skew:
        s_fx *= np.exp(-2j * np.pi * np.fft.rfftfreq(n, 1 / hits[0].sample_rate) * skew)
    s_ff, s_xx = (powers[:, ::2] + powers[:, 1::2]) / len(hits)
    return s_ff, s_xx, s_fx * (1 / len(hits))


def _skew(hit: Hit) -> float:
    """How much later the response is sampled than the force (s): its spectrum leads by 2 pi f skew."""
    return hit.channels[1].skew - hit.channels[0].skew if hit.channels else 0.0


def usable_band(frequency: NDArray[np.floating[Any]], s_ff: NDArray[np.float64]) -> tuple[float, float]:
    """From the first line to the first one where the force spectrum has fallen 20 dB below its largest value."""
    weak = np.flatnonzero(s_ff[1:] < 0.01 * np.max(s_ff[1:]))
    return float(frequency[1]), float(frequency[weak[0] if weak.size else -1])
