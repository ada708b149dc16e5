"""Find a steady line in the response at rest: a turning spindle, or mains hum."""

from dataclasses import dataclass

import numpy as np

from acquisition import Channel, Hit
from acquisition.errors import join_sentences
from dsm import format_rounded
from lobewatch.arrays import Flags, Floats

MAINS = (50.0, 60.0)
"""Mains frequencies (Hz)."""
CHECKED_HARMONICS = 6
"""Number of harmonics checked."""
MIN_LINE_POWER_SHARE = 0.5
"""Share of the power at rest in a line and its harmonics that is reported, chosen."""
MIN_LINE_CODES = 3.0
"""RMS of such a line (converter steps) below which it is ignored, chosen."""
DRIFT_LINES = 5
"""Number of lowest lines of a record, which a drift fills, chosen."""
MIN_FUNDAMENTAL_SHARE = 0.01
"""Smallest share of the power of mains hum in its first two harmonics, chosen: a line at 200 Hz without one at 50 or
100 Hz, a tenth as high, is no hum.
"""
MAX_HUM_RANGE_SHARE = 1e-3
"""Largest rms of mains hum over the range of the accelerometer about which nobody is asked, chosen.

Next to hits that use a third of the range, such hum at 50 to 300 Hz changes f, zeta and K of a mode at 1713 Hz by
0.001 % or less, but the FRF at its own lines by more than their coherent response.
"""


@dataclass(frozen=True)
class SteadyLine:
    """Line that dominates the response at rest."""

    frequency: float
    """Frequency (Hz)."""
    rms: float
    """RMS with its harmonics (m/s^2)."""
    range_share: float
    """RMS over the range of the sensor."""
    is_hum: bool
    """True if mains hum explains it, but a spindle with that speed does, too."""

    @property
    def is_asked(self) -> bool:
        """True if a person must say that the spindle stands still."""
        return not self.is_hum or self.range_share > MAX_HUM_RANGE_SHARE

    @property
    def finding(self) -> str:
        """Finding with its causes, without the full stop."""
        vibration = f"steady vibration of {format_rounded(self.rms, digits=2)} m/s^2 rms at {self.frequency:.0f} Hz"
        on_mains = any(_is_multiple(self.frequency, mains) for mains in MAINS)
        other = "mains hum" if on_mains else "another machine vibrates"
        return f"{vibration}: the spindle turns at {60 * self.frequency:.0f} rpm, or {other}"

    @property
    def text(self) -> str:
        """Finding and remedy in sentences."""
        cure = "If the spindle stands still, check the accelerometer cable, its shield and nearby machines"
        return join_sentences(self.finding, "Stop the spindle", cure)


def find_steady_line(record: Hit) -> SteadyLine | None:
    """Find the line that makes up most of the response in a record without hits, None without one."""
    channel = record.channels[-1] if record.channels else None
    frequency, power = compute_power_spectrum(record.acceleration, record.sample_rate)
    least = MIN_LINE_POWER_SHARE * float(np.sum(power))
    rms, mains = measure_hum(frequency, power)
    lines = [sum_lines(frequency, power, mains * k) for k in range(1, CHECKED_HARMONICS + 1)]
    is_hum = rms**2 > least and sum(lines[:2]) >= MIN_FUNDAMENTAL_SHARE * rms**2
    line = mains * (1 + int(np.argmax(lines)))
    if not is_hum:
        line = float(frequency[DRIFT_LINES + int(np.argmax(power[DRIFT_LINES:]))])
        rms = float(np.sqrt(sum_lines(frequency, power, *list_harmonics(line))))
    if rms**2 <= least or rms <= (MIN_LINE_CODES * abs(channel.scale) if channel else 0.0):
        return None
    return SteadyLine(line, rms, rms / _full_scale(channel), is_hum)


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


def _is_multiple(line: float, mains: float) -> bool:
    """Return whether a line, known to 1 Hz, is a harmonic of the mains."""
    return round(line / mains) >= 1 and abs(line - mains * round(line / mains)) <= 1


def _full_scale(channel: Channel | None) -> float:
    return channel.full_scale / abs(channel.sensitivity) if channel else np.inf
