"""Find a steady line in the response at rest: a turning spindle, or mains hum."""

from dataclasses import dataclass

import numpy as np

from acquisition import Hit
from acquisition.errors import join_sentences
from dsm import format_rounded
from lobewatch.arrays import Flags, Floats

MAINS = (50.0, 60.0)
"""Mains frequencies (Hz)."""
CHECKED_HARMONICS = 6
"""Number of harmonics checked."""
MIN_LINE_POWER_SHARE = 0.5
"""Share of the power at rest in mains lines that the self-check reports as hum, chosen."""
MIN_HUM_CODES = 3.0
"""RMS of such hum (converter steps) below which it is ignored, chosen."""
MIN_LINE_CODES = 1.0
"""RMS of a line (converter steps) below which it is ignored: a signal that alternates between two steps has 0.5.

Noise of MIN_DITHER_CODES spreads the signal over more steps, so that averages show smaller lines, too."""
MIN_DITHER_CODES = 0.55
"""RMS of the rest (converter steps) from which a converter is linear on average: two alternating steps have 0.5.

A signal that stays within one step is a constant. No average shows a vibration there (Wannamaker et al. 2000, A theory
of nonsubtractive dither, IEEE Trans. Signal Process. 48)."""
DRIFT_LINES = 5
"""Number of lowest lines of a record, which a drift fills, chosen."""
MIN_LINE_VELOCITY = 0.28e-3
"""RMS velocity (m/s) from which a line is a turning spindle, at mains frequencies, too.

Smallest vibration severity of ISO 10816-1:1995, table B.1. At 3000 rpm it is 0.09 m/s^2. Healthy spindles have 0.3 to
1 m/s^2 there, and floors next to machines less than 0.2 mm/s.
"""
MIN_NEW_LINE_VELOCITY, MIN_NEW_LINE_RATIO = 0.05e-3, 5.0
"""Smallest RMS velocity (m/s) of a new line, and smallest ratio of its rms to that in an earlier record; chosen.

Vibration of the floor is in both records."""
MIN_LINE_PROMINENCE = 60.0
"""Power of a line over the median of the lines around it, chosen: at most 58 in 1200 records of noise and drift."""
NEIGHBOUR_LINES = 15
"""Number of lines on each side of a line that give this median, chosen: several times as wide as a line."""
MIN_ODD_SHARE = 0.02
"""Power of the third and fifth mains harmonic over the first from which they show electrical hum, chosen."""
MIN_ODD_RATIO = 4.0
"""Power of the odd over the even higher harmonics of electrical hum, chosen: an unbalanced or misaligned spindle has
the second, saturated transformers and chokes have odd ones.
"""


@dataclass(frozen=True)
class SteadyLine:
    """Steady line in the response at rest."""

    frequency: float
    """Frequency (Hz)."""
    rms: float
    """RMS with its harmonics (m/s^2)."""
    power_share: float
    """Share of the power at rest."""
    is_hum: bool
    """True if its harmonics are those of electrical hum."""

    @property
    def is_asked(self) -> bool:
        """True if a person must say that the spindle stands still."""
        return not self.is_hum

    @property
    def finding(self) -> str:
        """Finding with its causes, without the full stop."""
        vibration = f"steady vibration of {format_rounded(self.rms, digits=2)} m/s^2 rms at {self.frequency:.0f} Hz"
        other = "another machine vibrates" if _find_mains_multiple(self.frequency) is None else "mains hum"
        return f"{vibration}: the spindle turns at {60 * self.frequency:.0f} rpm, or {other}"

    @property
    def text(self) -> str:
        """Finding and remedy in sentences."""
        cure = "If the spindle stands still, check the accelerometer cable, its shield and nearby machines"
        return join_sentences(self.finding, "Stop the spindle", cure)


def find_steady_line(record: Hit, min_velocity: float = MIN_LINE_VELOCITY) -> SteadyLine | None:
    """Find the steady line with the largest velocity in a record without hits, None without one.

    Electrical hum is returned only if there is no other line. min_velocity: rms (m/s).
    """
    frequency, power = compute_power_spectrum(record.acceleration, record.sample_rate)
    prominent = power > MIN_LINE_PROMINENCE * _find_local_medians(power)
    prominent[:DRIFT_LINES] = False
    step = abs(record.channels[-1].scale) if record.channels else 0.0
    lines = [mains for mains in MAINS if is_electrical_hum(frequency, power, mains)]
    hum = _select_lines(frequency, *(line for mains in lines for line in list_harmonics(mains)))
    for is_hum, usable in ((False, prominent & ~hum), (True, prominent & hum)):
        line = _find_fastest_line(frequency, power, usable, min_velocity)
        rms = 0.0 if line is None else float(np.sqrt(sum_lines(frequency, power, *list_harmonics(line))))
        total = float(np.sum(power))
        is_dithered = total - rms**2 >= (MIN_DITHER_CODES * step) ** 2
        if line is not None and (is_dithered or rms > MIN_LINE_CODES * step):
            return SteadyLine(line, rms, rms**2 / total, is_hum)
    return None


def find_new_line(record: Hit, baseline: Hit) -> SteadyLine | None:
    """Find a steady line in a record without hits that is weak in an earlier one, however small its velocity is.

    A spindle that begins to turn slowly has the line, the floor and nearby machines have it in both records.
    """
    line = find_steady_line(record, MIN_NEW_LINE_VELOCITY)
    if line is None or line.rms < MIN_NEW_LINE_RATIO * measure_line(baseline, line.frequency):
        return None
    return line


def measure_line(record: Hit, frequency: float) -> float:
    """Return the rms of the response at a frequency (Hz) and its harmonics (m/s^2)."""
    lines = compute_power_spectrum(record.acceleration, record.sample_rate)
    return float(np.sqrt(sum_lines(*lines, *list_harmonics(frequency))))


def is_electrical_hum(frequency: Floats, power: Floats, mains: float) -> bool:
    """Return whether lines at a mains frequency (Hz) and its harmonics have the pattern of electrical hum."""
    first, *higher = (sum_lines(frequency, power, line) for line in list_harmonics(mains))
    odd, even = sum(higher[1::2]), sum(higher[::2])
    return first > max(higher) and odd >= MIN_ODD_SHARE * first and odd >= MIN_ODD_RATIO * even


def _find_fastest_line(frequency: Floats, power: Floats, usable: Flags, min_velocity: float) -> float | None:
    """Return the frequency of the usable line with the largest velocity (Hz), None if all are slow."""
    velocity = power / (2 * np.pi * np.maximum(frequency, frequency[1])) ** 2
    highest = int(np.argmax(np.where(usable, velocity, 0.0)))
    if not usable[highest] or sum_lines(frequency, velocity, frequency[highest]) < min_velocity**2:
        return None
    near = slice(highest - 2, highest + 3)
    line = float(np.average(frequency[near], weights=power[near]))
    return _find_mains_multiple(line) or line


def _find_local_medians(power: Floats) -> Floats:
    """Return the median of each power and its neighbours."""
    padded = np.pad(power, NEIGHBOUR_LINES, mode="reflect")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * NEIGHBOUR_LINES + 1)
    return np.asarray(np.median(windows, axis=1))


def compute_power_spectrum(signal: Floats, rate: float) -> tuple[Floats, Floats]:
    """Return frequencies (Hz) and power of a Hann-windowed record. The powers add up to its mean square."""
    window = np.hanning(signal.size)
    power = np.abs(np.fft.rfft((signal - np.mean(signal)) * window)) ** 2
    return np.arange(power.size) * rate / signal.size, 2 * power / (signal.size * np.sum(window**2))


def measure_hum(frequency: Floats, power: Floats) -> tuple[float, float]:
    """Return the rms at mains lines, and the mains frequency (Hz) that explains more."""
    sums = [sum_lines(frequency, power, *list_harmonics(mains)) for mains in MAINS]
    return float(np.sqrt(max(sums))), MAINS[int(np.argmax(sums))]


def sum_lines(frequency: Floats, power: Floats, *lines: float) -> float:
    """Return the power at lines (Hz), over which a Hann window spreads each."""
    return float(np.sum(power[_select_lines(frequency, *lines)]))


def list_harmonics(line: float) -> list[float]:
    """Return a frequency and its harmonics (Hz)."""
    return [line * k for k in range(1, CHECKED_HARMONICS + 1)]


def _select_lines(frequency: Floats, *lines: float) -> Flags:
    return np.asarray(np.any([np.abs(frequency - line) <= 2 * frequency[1] for line in lines], axis=0))


def _find_mains_multiple(line: float) -> float | None:
    """Return the harmonic of the mains that a line, known to 1 Hz, can be (Hz), None without one."""
    multiples = (mains * max(round(line / mains), 1) for mains in MAINS)
    return next((multiple for multiple in multiples if abs(line - multiple) <= 1), None)
