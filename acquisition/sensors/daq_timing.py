"""Measure the sample rate and the channel skew of a DAQ."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from acquisition.arrays import Complexes, Floats
from acquisition.errors import DeviceError, Remark
from acquisition.source import Source

RATE_TOLERANCE = 0.002
"""Relative deviation of the measured sample rate from the nominal one that is accepted."""
ACCURATE_RATE_STD = RATE_TOLERANCE / 4
"""Relative standard error up to which a measured rate is accurate."""
MAX_RATE_STD = RATE_TOLERANCE
"""Relative standard error above which a rate cannot be measured."""
MIN_RATE_BLOCKS = 10
"""Block arrivals needed for a slope and its error."""
USB_POLL_INTERVAL = 1e-3
"""Uncertainty of both ends of the time (s): a USB host polls its devices once a millisecond."""
RATE_STRETCHES = 20
"""Stretches of the stream. Only the least delayed block of each counts."""


@dataclass(frozen=True)
class MeasuredRate:
    """Measured sample rate of a stream.

    Examples
    --------
    >>> MeasuredRate(rate=25600.2, std=0.5, n_scans=128000, seconds=5.0).is_accurate
    True
    """

    rate: float
    """Sample rate (Hz)."""
    std: float
    """Standard error of the rate (Hz)."""
    n_scans: int
    """Scans between the first and the last block."""
    seconds: float
    """Time between them (s)."""

    @property
    def is_accurate(self) -> bool:
        """True if the standard error is at most 0.05 %."""
        return self.std <= ACCURATE_RATE_STD * self.rate


def measure_rate(source: Source, seconds: float = 5.0, clock: Callable[[], float] = time.monotonic) -> MeasuredRate:
    """Start a source, count its scans against the clock, and stop it.

    A block can arrive late, never early. The stream is cut into 20 stretches. The block with the least delay of each is
    kept, stretches that are late as a whole (a busy computer) are omitted, and time is regressed on the scan count.
    The standard error is that of the slope, enlarged if neighbouring residuals are similar (lag-1 correlation), and
    combined with that of two ends each known to 1 ms (rectangular: 1 ms / sqrt(6) over the whole time).

    Parameters
    ----------
    source
        Source to start.
    seconds
        Length of the measurement (s).
    clock
        Function that returns the time (s).

    Returns
    -------
    MeasuredRate
        Sample rate and its standard error.

    Raises
    ------
    ValueError
        `seconds` is not > 0.
    DeviceError
        Fewer than 10 blocks arrive, the stream ends too early, or the source fails.

    Examples
    --------
    >>> fast = SimulatedSource(lambda first, n: np.zeros((1, n)), (Channel("force", 2.25e-3, 5.0),), 10240.0, 10**6)
    >>> ticks = iter(np.arange(10**6) * 0.05)  # s: a clock by which a block of 512 scans comes every 50 ms
    >>> round(measure_rate(fast, seconds=5.0, clock=lambda: next(ticks)).rate)  # Hz
    10240
    """
    if not (np.isfinite(seconds) and seconds > 0):
        raise ValueError(f"seconds={seconds} is not above 0. Give about 5 s to measure a sample rate.")
    arrived: list[float] = []
    scans: list[int] = []
    source.start()
    for block in source.blocks():
        arrived.append(clock())
        scans.append(block.first_scan + block.codes.shape[1])
        if arrived[-1] - arrived[0] >= seconds:
            break
    source.stop()
    elapsed = arrived[-1] - arrived[0] if scans else 0.0
    if len(scans) < MIN_RATE_BLOCKS or elapsed < seconds:
        needed = f"but at least {MIN_RATE_BLOCKS} in {seconds:g} s are needed"
        text = f"the DAQ sent {len(scans)} blocks of samples in {elapsed:.2g} s, {needed}"
        raise DeviceError(text, "Check the sample rate and the cable of the DAQ")
    return fit_rate(scans, arrived)


def fit_rate(scans: ArrayLike, arrived: ArrayLike) -> MeasuredRate:
    """Fit the sample rate to the arrival times of blocks, as `measure_rate` does.

    Parameters
    ----------
    scans : array_like, shape (n,)
        Number of scans of the stream up to the end of each block, n >= 10.
    arrived : array_like, shape (n,)
        Time of arrival of each block (s).

    Returns
    -------
    MeasuredRate
        Sample rate and its standard error.

    Examples
    --------
    >>> round(fit_rate(512 * np.arange(100), 0.05 * np.arange(100)).rate)  # Hz
    10240
    """
    counts, times = np.asarray(scans, dtype=np.float64), np.asarray(arrived, dtype=np.float64)
    n_scans, elapsed = counts[-1] - counts[0], times[-1] - times[0]
    period, scatter = _fit_scan_period(counts, times)
    std = float(np.hypot(scatter, USB_POLL_INTERVAL / np.sqrt(6) / n_scans) / period**2)
    return MeasuredRate(float(1 / period), std, int(n_scans), float(elapsed))


def check_rate(measured: MeasuredRate, nominal: float) -> None:
    """Check a measured sample rate against the nominal one.

    The rates may differ by 0.2 %, and by two standard errors more if the measured rate is not accurate.

    Parameters
    ----------
    measured
        Measured sample rate.
    nominal
        Nominal sample rate (Hz).

    Raises
    ------
    DeviceError
        The rates differ by more, or the standard error exceeds 0.2 %.

    Examples
    --------
    >>> check_rate(MeasuredRate(25600.2, 0.5, 128000, 5.0), nominal=25600.0)
    >>> check_rate(MeasuredRate(24000.0, 0.5, 120000, 5.0), nominal=25600.0)
    Traceback (most recent call last):
        ...
    acquisition.errors.DeviceError: the DAQ samples at 24000.00 ± 0.50 Hz, not 25600 Hz, so ...
    """
    if measured.std > MAX_RATE_STD * measured.rate:
        rate = f"{measured.rate:.6g} Hz, standard error {measured.std / measured.rate:.2%}, limit {MAX_RATE_STD:.2%}"
        text = f"the sample rate of the DAQ cannot be measured, because data arrive too unevenly ({rate})"
        raise DeviceError(text, "Close other programs and measure the sample rate again")
    off = nominal / measured.rate - 1
    if abs(measured.rate / nominal - 1) > RATE_TOLERANCE + (0 if measured.is_accurate else 2 * measured.std / nominal):
        error = f"so every frequency would be {abs(off):.1%} too {'high' if off > 0 else 'low'}"
        text = f"the DAQ samples at {measured.rate:.2f} ± {measured.std:.2f} Hz, not {nominal:g} Hz, {error}"
        raise DeviceError(text, "Correct the sample rate of the DAQ, or use the measured rate")


def rate_remark(measured: MeasuredRate) -> Remark | None:
    """Return the remark on a sample rate that is not accurate.

    Parameters
    ----------
    measured
        Measured sample rate.

    Returns
    -------
    Remark or None
        Remark, None if the rate is accurate.
    """
    if measured.is_accurate:
        return None
    share = measured.std / measured.rate
    text = f"the sample rate of the DAQ, and so every frequency, has a standard error of {share:.2%}"
    remedy = "Close other programs and measure the sample rate again with acquisition.measure_rate"
    return Remark("rate-not-sure", "", text, remedy)


def _fit_scan_period(scans: Floats, arrived: Floats) -> tuple[float, float]:
    """Return seconds per scan and standard error, from the least delayed block of each stretch."""
    period = (arrived[-1] - arrived[0]) / (scans[-1] - scans[0])
    std = 0.0
    stretches = np.array_split(np.arange(scans.size), min(RATE_STRETCHES, scans.size))
    for _ in range(4):  # which block is the least delayed depends on the period
        delay = arrived - arrived[0] - period * (scans - scans[0])
        best = np.array([stretch[np.argmin(delay[stretch])] for stretch in stretches])
        correction, std = _fit_robust_slope(scans[best], delay[best])
        period += correction
    return period, std


def _fit_robust_slope(x: Floats, y: Floats) -> tuple[float, float]:
    """Return least-squares slope and standard error without the points far above the others."""
    first, second = np.triu_indices(x.size, 1)
    rough = y - float(np.median((y[second] - y[first]) / (x[second] - x[first]))) * x  # slope of Theil and Sen
    above = rough - np.median(rough)
    spread = 1.4826 * np.median(np.abs(above))
    keep = above <= 4 * spread + 1e-9
    x, y = x[keep] - np.mean(x[keep]), y[keep] - np.mean(y[keep])
    slope = float(x @ y / (x @ x))
    residual = y - slope * x
    energy = float(residual @ residual)
    alike = float(np.clip(residual[1:] @ residual[:-1] / energy, 0.0, 0.9)) if energy > 0 else 0.0
    variance = energy / (x.size - 2) / float(x @ x) * (1 + alike) / (1 - alike)
    return slope, float(np.sqrt(variance))


SKEW_SEGMENT_SAMPLES = 1024
"""Samples per segment."""
MIN_SKEW_SEGMENTS = 16
"""Segments needed for a coherence and a standard error."""
MIN_SKEW_COHERENCE = 0.9
"""Lowest coherence of a line that counts."""
MIN_COHERENT_SHARE = 0.1
"""Lowest share of lines that must count. One hum line determines no delay."""
CORRELATION_OVERSAMPLING = 16
"""Oversampling of the correlation whose maximum is the first estimate."""


@dataclass(frozen=True)
class MeasuredSkew:
    """Delay of the second channel's samples."""

    skew: float
    """Time by which the second channel samples later than the first (s), the value for Channel.skew."""
    std: float
    """Standard error of the skew (s)."""
    coherent_share: float
    """Share of the frequency lines that counted (-)."""


def measure_skew(first: ArrayLike, second: ArrayLike, sample_rate: float) -> MeasuredSkew:
    """Measure the skew of two channels that record the same broad-band signal.

    The second channel takes y_k = x(t_k + s), so that conj(X) Y has the phase 2 pi f s. A line through zero is fitted
    to the phase of the mean over Hann-windowed segments, weighted by g2 / (1 - g2) with the coherence g2, the
    reciprocal of its variance. The standard error is a jackknife over the segments. The second record is then shifted
    back by the skew and the rest fitted again, twice: segments that do not contain the same piece of the signal, and
    leakage, would bend the phase a little.

    Parameters
    ----------
    first, second : array_like, shape (n,)
        Records of both channels, in any unit.
    sample_rate
        Sample rate (Hz).

    Returns
    -------
    MeasuredSkew
        Skew and its standard error.

    Raises
    ------
    ValueError
        The records differ in length, are shorter than 16 segments of 1024, hold NaN or inf, are not coherent, or have
        opposite signs.

    References
    ----------
    Bendat & Piersol, Random Data, ch. 9.

    Examples
    --------
    >>> noise = np.random.default_rng(1).normal(size=32769)
    >>> skew = measure_skew(noise[:-1], noise[1:], 51200.0)  # the second channel is a sample late
    >>> f"{skew.skew * 1e6:.2f} us, {1e6 / 51200:.2f} us"
    '19.53 us, 19.53 us'
    """
    if not (np.isfinite(sample_rate) and sample_rate > 0):
        raise ValueError(f"sample_rate={sample_rate} Hz is not above 0")
    records = _check_records(first, second)
    fit = _fit_phase_slope(records, records[1])
    for _ in range(2):
        turn = np.exp(-2j * np.pi * np.fft.rfftfreq(records[1].size) * fit.skew)
        earlier = np.asarray(np.fft.irfft(np.fft.rfft(records[1]) * turn, records[1].size))  # its ends are not right
        correction = _fit_phase_slope(records, earlier)
        fit = replace(correction, skew=fit.skew + correction.skew)
    return replace(fit, skew=fit.skew / sample_rate, std=fit.std / sample_rate)


def _fit_phase_slope(records: Floats, second: Floats) -> MeasuredSkew:
    """Return the skew of records[0] and second, in samples."""
    cross, power = _segment_spectra(np.stack([records[0], second]))
    mean = np.mean(cross, axis=0)
    g2 = np.abs(mean) ** 2 / np.maximum(np.prod(np.mean(power, axis=1), axis=0), np.finfo(float).tiny)
    counts = (g2 > MIN_SKEW_COHERENCE) & (np.arange(g2.size) > 0)
    share = float(np.mean(counts))
    if share < MIN_COHERENT_SHARE:
        shares = f"over {MIN_SKEW_COHERENCE:g} at {share:.0%} of the lines, required {MIN_COHERENT_SHARE:.0%}"
        text = f"the two channels do not record the same broad-band signal (coherence {shares})"
        raise ValueError(f"{text}. Join both inputs with a T-piece and feed the same noise or taps into both.")
    omega = 2 * np.pi * np.fft.rfftfreq(SKEW_SEGMENT_SAMPLES)[counts]
    rough = _find_correlation_peak(np.where(counts, mean, 0.0))
    turned = cross[:, counts] * np.exp(-1j * omega * rough)
    if np.sum(turned).real < 0:
        raise ValueError("the two channels have opposite signs. Swap the wires or the polarity of the second channel.")
    weight = omega * g2[counts] / np.maximum(1 - g2[counts], 1e-9)
    weight /= weight @ omega
    n = cross.shape[0]
    without_one = (n * np.mean(turned, axis=0) - turned) / (n - 1)
    std = np.sqrt((n - 1) * np.var(np.angle(without_one) @ weight))
    return MeasuredSkew(rough + float(np.angle(np.mean(turned, axis=0)) @ weight), float(std), share)


def _check_records(first: ArrayLike, second: ArrayLike) -> Floats:
    records = [np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)]
    n_least = MIN_SKEW_SEGMENTS * SKEW_SEGMENT_SAMPLES
    for record, name in zip(records, ("first", "second"), strict=True):
        if record.ndim != 1 or record.size < n_least or not np.all(np.isfinite(record)):
            raise ValueError(f"the {name} record has shape {record.shape}. Give {n_least} or more finite samples.")
    if records[0].size != records[1].size:
        raise ValueError(f"the records differ in length: {records[0].size} and {records[1].size} samples")
    return np.stack([record - np.mean(record) for record in records])


def _segment_spectra(records: Floats) -> tuple[Complexes, Floats]:
    """Return conj(X) Y of each segment but the two at the ends (n, lines), and |X|^2, |Y|^2 (2, n, lines)."""
    n = records.shape[1] // SKEW_SEGMENT_SAMPLES
    segments = records[:, : n * SKEW_SEGMENT_SAMPLES].reshape(2, n, SKEW_SEGMENT_SAMPLES)[:, 1:-1]
    spectra = np.fft.rfft((segments - segments.mean(axis=2, keepdims=True)) * np.hanning(SKEW_SEGMENT_SAMPLES))
    return np.conj(spectra[0]) * spectra[1], np.abs(spectra) ** 2


def _find_correlation_peak(cross: Complexes) -> float:
    """Return the skew, to a fraction of a sample, at the largest magnitude of the correlation."""
    size = CORRELATION_OVERSAMPLING * SKEW_SEGMENT_SAMPLES
    lag = int(np.argmax(np.abs(np.fft.irfft(cross, size))))
    return -(lag - size if lag > size // 2 else lag) / CORRELATION_OVERSAMPLING
