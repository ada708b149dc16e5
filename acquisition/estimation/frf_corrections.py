"""Correct an FRF for windows and the mass of the sensor, and infer its unstated processing."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from acquisition.arrays import Floats
from acquisition.frf import Frf
from acquisition.hit import Hit
from acquisition.hits.pulse import count_pre_hit_samples, extract_baseline, require_pulse


def apply_exponential_window(hit: Hit, time_constant: float) -> Hit:
    """Multiply force and response, without their offsets, by exp(-t/time_constant) from the hit on.

    With both windowed the FRF is that of the structure at a shifted frequency, H(s + 1/time_constant), exactly and for
    any length of the pulse: exp(-at) (h * f) = (exp(-at) h) * (exp(-at) f).

    Parameters
    ----------
    hit
        Hit with a pulse.
    time_constant
        Time constant of the window (s), > 0.

    Returns
    -------
    Hit
        Windowed hit without codes.

    Raises
    ------
    ValueError
        For a hit without a pulse, and for a time constant that is not > 0.

    Examples
    --------
    >>> force = np.zeros(1000)
    >>> force[100:110] = 200.0  # N
    >>> windowed = apply_exponential_window(Hit(force, np.ones(1000), 10000.0, pre_trigger=100), time_constant=0.02)
    >>> round(find_hit_time(windowed) * 1e3, 2), round(measure_time_after_hit(windowed) * 1e3, 2)  # ms
    (10.45, 89.55)
    """
    if not time_constant > 0:
        raise ValueError(f"time_constant={time_constant} s is not above 0")
    pulse = require_pulse(hit)
    after = np.maximum(np.arange(hit.force.size) - pulse.start, 0) / hit.sample_rate
    window = np.exp(-after / time_constant)
    still = hit.acceleration - np.mean(extract_baseline(hit.acceleration, count_pre_hit_samples(hit)))
    return replace(hit, force=pulse.force * window, acceleration=still * window, codes=None)


def correct_windowed_receptance(frf: Frf, time_constant: float) -> Frf:
    """Correct the receptance of an FRF whose responses were recorded under an exponential window.

    Acceleration under the window is receptance times s^2 at s = 2 pi i f + 1/time_constant, velocity is receptance
    times s.

    Parameters
    ----------
    frf
        FRF as it was measured; one measured as receptance is right as it is.
    time_constant
        Time constant of the window (s).

    Returns
    -------
    Frf
        FRF with the corrected receptance.

    Examples
    --------
    >>> line, tau = np.array([100.0, 200.0]), 0.05
    >>> seen = from_accelerance(line, (2j * np.pi * line + 1 / tau) ** 2 * 1e-8)  # 0.01 um/N under a window
    >>> round(float(correct_windowed_receptance(seen, tau).receptance[0].real) * 1e6, 6)  # um/N
    0.01
    """
    if frf.measured_as == "receptance":
        return frf
    s = 2j * np.pi * frf.frequency
    share = s / (s + 1 / time_constant)
    return replace(frf, receptance=frf.receptance * (share if frf.measured_as == "mobility" else share**2))


def find_hit_time(hit: Hit) -> float:
    """Find the time of the hit, the centre of its pulse.

    Parameters
    ----------
    hit
        Hit with a pulse.

    Returns
    -------
    float
        Time from the start of the record (s).

    Raises
    ------
    ValueError
        For a hit without a pulse.

    Examples
    --------
    >>> force = np.zeros(1000)
    >>> force[100:110] = 200.0  # N, samples at 10.0 to 10.9 ms
    >>> hit = Hit(force, np.zeros(1000), 10000.0, pre_trigger=100)
    >>> round(find_hit_time(hit) * 1e3, 2)  # ms
    10.45
    """
    pulse = require_pulse(hit)
    part = slice(max(pulse.start, 0), pulse.end)
    return float(np.average(np.arange(hit.force.size)[part], weights=pulse.force[part])) / hit.sample_rate


def measure_time_after_hit(hit: Hit) -> float:
    """Measure the length of the record after the hit.

    Parameters
    ----------
    hit
        Hit with a pulse.

    Returns
    -------
    float
        Time from the hit to the end of the record (s).

    Raises
    ------
    ValueError
        For a hit without a pulse.

    Examples
    --------
    >>> force = np.zeros(1000)
    >>> force[100:110] = 200.0  # N, at 10 ms of a record of 100 ms
    >>> hit = Hit(force, np.zeros(1000), 10000.0, pre_trigger=100)
    >>> round(measure_time_after_hit(hit) * 1e3, 2)  # ms
    89.55
    """
    return hit.force.size / hit.sample_rate - find_hit_time(hit)


def remove_sensor_mass(frf: Frf, mass: float) -> Frf:
    """Remove the mass of the sensor from the FRF of a driving point.

    The structure feels the hammer's force and -mass x acceleration of the sensor, so that 1/H = 1/H_m + mass w^2 with
    the measured receptance H_m. This does not hold where the response is not at the hammer's point.

    Parameters
    ----------
    frf
        Measured FRF.
    mass
        Mass that moves with the driving point (kg).

    Returns
    -------
    Frf
        FRF without the mass; the same for 0 kg.

    References
    ----------
    Ashory (1998), Correction of mass-loading effects of transducers, IMAC 16.

    Examples
    --------
    A sensor of 20 g on a mass of 2 kg:

    >>> measured = from_accelerance([100.0, 200.0], [1 / 2.02, 1 / 2.02])
    >>> round(float(1 / remove_sensor_mass(measured, 0.02).accelerance[0].real), 6)  # kg
    2.0
    """
    if mass == 0:
        return frf
    loading = 1 + mass * (2 * np.pi * frf.frequency) ** 2 * frf.receptance
    return replace(frf, receptance=frf.receptance / loading, mass_removed=frf.mass_removed + mass)


COHERENCE_BLOCK_LINES = 32
"""Number of lines averaged together."""
MIN_COHERENCE_BLOCKS = 4
"""Smallest number of blocks for a certain answer."""
MAX_QUARTILE_RATIO = 3.0
"""Ratio of the upper to the lower quartile of the blocks above which the coherence does not belong to the FRF."""
MIN_INCOHERENCE = 1e-7
"""Smallest 1 - coherence above rounding."""


def infer_averages(frf: Frf) -> int | None:
    """Infer the number of averaged hits from the scatter of an FRF and its coherence.

    The coherence gives the scatter of single hits, |H|^2 (1 - g2)/g2. The mean of n hits scatters by 1/n of that, which
    third differences of neighbouring lines show. The noise of neighbouring lines is assumed independent: a Hann window
    or interpolated lines make the answer too large. Its error is about 15 % with 500 lines.

    Parameters
    ----------
    frf
        FRF with its coherence.

    Returns
    -------
    int or None
        Number of hits; None if it cannot be inferred.

    References
    ----------
    Variance of H1, Bendat & Piersol, Random Data, ch. 9; n - 1 degrees of freedom of the residual of n hits.

    Examples
    --------
    >>> random = np.random.default_rng(1)
    >>> noise = random.normal(0.0, 0.1, (2, 2000)) / np.sqrt(2 * 8)  # of a mean of 8
    >>> frf = Frf(np.arange(1.0, 2001.0), 1 + noise[0] + 1j * noise[1], coherence=np.full(2000, 1 / 1.01))
    >>> infer_averages(frf)  # some 15 % of error
    9
    """
    if frf.coherence is None:
        return None
    g2 = np.clip(frf.coherence, 1e-6, 1.0)[1:-2]
    of_hits = np.abs(frf.receptance[1:-2]) ** 2 * (1 - g2) / g2
    of_mean = np.abs(np.diff(frf.receptance, 3)) ** 2 / 20
    incoherent = _compute_block_means(1 - g2) > MIN_INCOHERENCE
    ratios = (_compute_block_means(of_hits) / np.maximum(_compute_block_means(of_mean), 1e-300))[incoherent]
    if ratios.size < MIN_COHERENCE_BLOCKS:
        return None
    low, middle, high = np.quantile(ratios, [0.25, 0.5, 0.75])
    return round(1 + middle) if high < MAX_QUARTILE_RATIO * low and middle > 1.5 else None


def _compute_block_means(values: Floats) -> Floats:
    whole = values[: values.size // COHERENCE_BLOCK_LINES * COHERENCE_BLOCK_LINES]
    return np.asarray(whole.reshape(-1, COHERENCE_BLOCK_LINES).mean(axis=1))


WINDOW_NOISE_RATIO = 2.0
"""Noise before the hit over that of the last tenth from which a window is inferred; chance reaches 1.3."""
MIN_WINDOW_SAMPLES = 32
"""Smallest number of samples before the hit."""


def infer_window(hits: Sequence[Hit]) -> float | None:
    """Infer an unstated exponential window over responses.

    No ringing after a hit can make its end quieter than before the hit, but a window does. The noise is that of
    differences of neighbouring samples, which hum hardly enters. The window falls from its middle before the hit to
    that of the last tenth. An end of zeros is padding and shows nothing.

    Parameters
    ----------
    hits
        Hits that were recorded in the same way.

    Returns
    -------
    float or None
        Approximate time constant (s); None if there is no sign of a window.
    """
    falls = [fall for fall in map(_measure_noise_drop, hits) if fall is not None]
    if not falls:
        return None
    ratio, apart = np.median(falls, axis=0)
    return float(apart / np.log(ratio)) if ratio > WINDOW_NOISE_RATIO else None


def _measure_noise_drop(hit: Hit) -> tuple[float, float] | None:
    """Return the noise before the hit over that at the end, and the time between (s); None if one is unknown."""
    before, tenth = int(0.8 * count_pre_hit_samples(hit)), hit.acceleration.size // 10
    if min(before, tenth) < MIN_WINDOW_SAMPLES:
        return None
    quiet, end = (np.std(np.diff(part)) for part in (hit.acceleration[:before], hit.acceleration[-tenth:]))
    apart = (hit.acceleration.size - tenth / 2 - before / 2) / hit.sample_rate
    return (float(quiet / end), apart) if end > 0 else None


TIME_PARTS = 40
"""Number of parts of the time that are compared."""
PADDING_DROP_RATIO = 10.0
"""Smallest ratio of the end of the record to what follows it, also relative to the decay just before the end."""
MIN_PADDING_LINES = 160
"""Smallest number of lines."""
MIN_PADDING_LEVEL = 1e-7
"""Smallest level with a meaning, as a share of the hit."""


def infer_recorded_share(frf: Frf) -> float:
    """Infer which share of one over the line spacing was recorded; the rest is zero padding.

    The lines of a padded record are closer than one over its length, and its impulse response with its noise ends at
    once where the zeros begin. Ringing falls no faster there than before. An unevenly spaced axis shows nothing.

    Parameters
    ----------
    frf
        FRF on an evenly spaced axis.

    Returns
    -------
    float
        Share, 0 to 1; 1 where nothing shows a padding.

    Examples
    --------
    >>> time = np.arange(1000)
    >>> decay = np.exp(-time / 200.0) * np.cos(time) + np.random.default_rng(1).normal(0.0, 0.01, 1000)
    >>> spectrum = np.fft.rfft(np.append(decay, np.zeros(1000)))[1:-1]  # filled up with as many zeros
    >>> round(infer_recorded_share(Frf(np.arange(1.0, 1000.0), spectrum)), 1)
    0.5
    """
    response = _compute_impulse_response(frf, MIN_PADDING_LINES)
    if response is None:
        return 1.0
    levels = np.array([np.sqrt(np.mean(part**2)) for part in np.array_split(response, TIME_PARTS)])
    for end in range(3, TIME_PARTS - 4):
        last, zeros = levels[end - 1], np.max(levels[end + 1 : -2])
        before = levels[end - 3] / last
        if last > max(PADDING_DROP_RATIO * zeros * max(before, 1.0), MIN_PADDING_LEVEL * np.max(response)):
            return (end + 0.5) / TIME_PARTS
    return 1.0


MIN_SMOOTHING_LINES = 128
"""Smallest number of lines."""
NEAR_HIT_SPAN, FAR_FROM_HIT_SPAN = (0.85, 0.95), (0.45, 0.55)
"""Spans of time, as shares of the record: just before the hit comes round again, and half a record away from it."""
SMOOTHING_NOISE_RATIO = 2.0
"""Noise near the hit over that far from it from which lines were smoothed; three smoothed lines give 2.3 or more."""
MAX_PRE_HIT_SHARE = 0.1
"""Largest noise before the hit, as a share of the hit; above it the phase of the FRF is conjugated."""
TAPER_LEAK_RATIO = 10.0
"""Smallest level with a meaning, over the leakage of the hit through the taper."""


def is_smoothed(frf: Frf) -> bool:
    """Return whether lines were smoothed over their neighbours, as a mean over them or a Hann window does.

    Smoothing lines means a window over the impulse response that falls away from the hit on both sides. Ringing decays
    after the hit and noise is the same everywhere, so nothing else leaves more just before the hit than half a record
    away. Only an evenly spaced axis with noise shows it.

    Parameters
    ----------
    frf
        FRF on an evenly spaced axis.

    Returns
    -------
    bool
        Whether the lines were smoothed.

    References
    ----------
    Bendat & Piersol, Random Data, ch. 11 (smoothing over frequency as a window over lag).
    """
    response = _compute_impulse_response(frf, MIN_SMOOTHING_LINES)
    if response is None:
        return False
    power, n = response**2, response.size
    spans = (slice(round(begin * n), round(end * n)) for begin, end in (NEAR_HIT_SPAN, FAR_FROM_HIT_SPAN))
    near, far = (float(np.mean(power[span])) for span in spans)
    leaks = TAPER_LEAK_RATIO * ((1 - NEAR_HIT_SPAN[1]) * n) ** -10
    return bool(near > SMOOTHING_NOISE_RATIO**2 * far and leaks < near / np.max(power) < MAX_PRE_HIT_SHARE**2)


def _compute_impulse_response(frf: Frf, min_lines: int) -> Floats | None:
    """Return the size of the tapered impulse response in the usable band; None for few or uneven lines."""
    frf = frf.in_band(frf.usable_band)
    steps = np.diff(frf.frequency)
    if frf.frequency.size < min_lines or np.ptp(steps) > 1e-3 * steps[0]:
        return None
    taper = np.hanning(frf.frequency.size + 2)[1:-1] ** 2
    return np.asarray(np.abs(np.fft.ifft(frf.accelerance * taper)))
