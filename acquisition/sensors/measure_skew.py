"""How much later one channel of a DAQ samples than another, from one signal fed to both."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

SEGMENT = 1024
"""Samples of a segment."""
FEWEST_SEGMENTS = 16
"""Segments needed for a coherence and a standard error."""
COHERENT = 0.9
"""Least coherence of a line that counts."""
COHERENT_SHARE = 0.1
"""Least share of the lines that must count: one hum line fixes no delay."""
OVERSAMPLING = 16
"""Of the correlation whose maximum is the first guess."""


@dataclass(frozen=True)
class MeasuredSkew:
    """Delay of the second channel's samples."""

    skew: float
    """The second channel samples so much later than the first (s); the value for Channel.skew."""
    std: float
    """Standard error of the skew (s)."""
    coherent_share: float
    """Share of the frequency lines that counted (-)."""


def measure_skew(first: ArrayLike, second: ArrayLike, sample_rate: float) -> MeasuredSkew:
    """Skew of two channels (n,) that were fed with one broad-band signal, in any unit, at a sample rate (Hz).

    The second channel takes y_k = x(t_k + s), so that conj(X) Y has the phase 2 pi f s. The phase of the mean over
    Hann-windowed segments is fitted by a line through zero, weighted by g2 / (1 - g2) with the coherence g2, the
    reciprocal of its variance (Bendat & Piersol, Random Data, ch. 9); the standard error is a jackknife over the
    segments. The second record is then shifted back by the skew and the rest fitted again, twice: windows that do not
    fall on the same piece of the signal, and lines that leak into their neighbours, would bend the phase a little.

    Raises ValueError for records that differ in length, are shorter than 16 segments of 1024 or hold NaN or inf, for
    two signals that are not the same one (coherence), and for a second channel of opposite sign.

    >>> noise = np.random.default_rng(1).normal(size=32769)
    >>> skew = measure_skew(noise[:-1], noise[1:], 51200.0)  # the second channel is a sample late
    >>> f"{skew.skew * 1e6:.2f} us, {1e6 / 51200:.2f} us"
    '19.53 us, 19.53 us'
    """
    if not (np.isfinite(sample_rate) and sample_rate > 0):
        raise ValueError(f"sample_rate={sample_rate} Hz is not > 0")
    records = _records(first, second)
    fit = _phase_slope(records, records[1])
    for _ in range(2):
        correction = _phase_slope(records, _shifted_back(records[1], fit.skew))
        fit = replace(correction, skew=fit.skew + correction.skew)
    return replace(fit, skew=fit.skew / sample_rate, std=fit.std / sample_rate)


def _phase_slope(records: NDArray[np.float64], second: NDArray[np.float64]) -> MeasuredSkew:
    """Skew of records[0] and second, in samples."""
    cross, power = _spectra(np.stack([records[0], second]))
    mean = np.mean(cross, axis=0)
    g2 = np.abs(mean) ** 2 / np.maximum(np.prod(np.mean(power, axis=1), axis=0), np.finfo(float).tiny)
    counts = (g2 > COHERENT) & (np.arange(g2.size) > 0)
    share = float(np.mean(counts))
    if share < COHERENT_SHARE:
        raise ValueError(
            f"the two channels do not carry one broad-band signal (coherence over {COHERENT:g} at {share:.0%} of the "
            f"lines, {COHERENT_SHARE:.0%} are needed); join both inputs with a T-piece and feed noise or taps"
        )
    omega = 2 * np.pi * np.fft.rfftfreq(SEGMENT)[counts]
    rough = _correlation_peak(np.where(counts, mean, 0.0))
    turned = cross[:, counts] * np.exp(-1j * omega * rough)
    if np.sum(turned).real < 0:
        raise ValueError("the second channel has the opposite sign of the first; swap its two wires or its polarity")
    weight = omega * g2[counts] / np.maximum(1 - g2[counts], 1e-9)
    weight /= weight @ omega
    n = cross.shape[0]
    without_one = (n * np.mean(turned, axis=0) - turned) / (n - 1)
    std = np.sqrt((n - 1) * np.var(np.angle(without_one) @ weight))
    return MeasuredSkew(rough + float(np.angle(np.mean(turned, axis=0)) @ weight), float(std), share)


def _shifted_back(record: NDArray[np.float64], samples: float) -> NDArray[np.float64]:
    """The record as it would have been taken so many samples earlier; its ends are not right."""
    turn = np.exp(-2j * np.pi * np.fft.rfftfreq(record.size) * samples)
    return np.asarray(np.fft.irfft(np.fft.rfft(record) * turn, record.size))


def _record(values: ArrayLike, name: str) -> NDArray[np.float64]:
    record = np.asarray(values, dtype=np.float64)
    if record.ndim != 1 or record.size < FEWEST_SEGMENTS * SEGMENT or not np.all(np.isfinite(record)):
        raise ValueError(
            f"the {name} record has shape {record.shape} or holds NaN or inf; "
            f"at least {FEWEST_SEGMENTS * SEGMENT} finite samples are needed"
        )
    return record - np.mean(record)


def _records(first: ArrayLike, second: ArrayLike) -> NDArray[np.float64]:
    records = [_record(first, "first"), _record(second, "second")]
    if records[0].size != records[1].size:
        raise ValueError(f"the records differ in length: {records[0].size} and {records[1].size} samples")
    return np.stack(records)


def _spectra(records: NDArray[np.float64]) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
    """conj(X) Y of every segment but the two at the ends (n, lines), and |X|^2, |Y|^2 (2, n, lines)."""
    n = records.shape[1] // SEGMENT
    segments = records[:, : n * SEGMENT].reshape(2, n, SEGMENT)[:, 1:-1]
    spectra = np.fft.rfft((segments - segments.mean(axis=2, keepdims=True)) * np.hanning(SEGMENT))
    return np.conj(spectra[0]) * spectra[1], np.abs(spectra) ** 2


def _correlation_peak(cross: NDArray[np.complex128]) -> float:
    """Skew, to a fraction of a sample, where the correlation of both channels is largest in size."""
    size = OVERSAMPLING * SEGMENT
    lag = int(np.argmax(np.abs(np.fft.irfft(cross, size))))
    return -(lag - size if lag > size // 2 else lag) / OVERSAMPLING
