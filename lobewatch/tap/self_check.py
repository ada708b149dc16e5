"""The self-check before the first hit: sensors and their calibration, and about a second in which nobody taps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from datetime import UTC, date, datetime

import numpy as np
from numpy.typing import NDArray

from acquisition import Channel, Hit, Remark, calibration_doubt, channel_doubts
from dsm import rounded
from lobewatch.machine.reserve import RESERVE_BYTES
from lobewatch.tap.state import Check

PIECE = 0.01
"""Length of the pieces by which a quiet stretch is found (s)."""
QUIET_FACTOR = 3.0
"""A piece is quiet where its rms is at most this many times that of the quietest fifth."""
SHORTEST = 0.1
"""A quiet stretch is at least so long (s)."""
LEVEL_NOISE_RATIO = 6.0
"""The trigger level should be this many times the rms of the force at rest."""
NOISE_SHARE = 0.02
"""The noise of the response should stay below this share of its range."""
MAINS = (50.0, 60.0)
"""Mains frequencies (Hz)."""
HARMONICS = 6
"""Lines of the mains looked at."""
HUM_SHARE = 0.5
"""Share of the power at rest in the lines of the mains that is called hum; chosen."""
TURNING_SHARE = 0.5
"""Share of the power at rest in another single line that is called a turning spindle; chosen."""
FEWEST_CODES = 3.0
"""Steps of the converter below which the rms of such lines is nothing; chosen."""
DISK_ROOM = 4
"""Free bytes of the disk over those that a test reserves, at least; chosen."""
WRONG = frozenset({"calibration-no-date", "calibration-in-future", "sample-rate-wrong"})
"""Codes of what cannot be, and is to be put right before a sensor or a DAQ is worked with."""


def quiet_stretch(record: Hit) -> Hit:
    """The longest part of a record without hits and their ringing; all of it where no part is quiet."""
    size = max(round(PIECE * record.sample_rate), 1)
    count = record.acceleration.size // size
    if count < 2:
        return record
    signals = record.signals[:, : count * size].reshape(-1, count, size)
    rms = np.std(signals, axis=2)
    floor = np.quantile(rms, 0.2, axis=1, keepdims=True)
    quiet = np.concatenate(([0], np.all(rms <= QUIET_FACTOR * floor, axis=0).astype(np.int8), [0]))
    starts, ends = np.flatnonzero(np.diff(quiet) == 1), np.flatnonzero(np.diff(quiet) == -1)
    if not starts.size or np.max(ends - starts) * PIECE < SHORTEST:
        return record
    best = int(np.argmax(ends - starts))
    return _part(record, int(starts[best]) * size, int(ends[best]) * size)


def self_check(baseline: Hit, level: float | None, free_bytes: int) -> tuple[Check, ...]:
    """One line each on samples, sensors, noise, hum, spindle and disk; level: of the trigger (N), None where trial
    hits choose it. baseline: a record from a DAQ in which nobody taps."""
    if baseline.codes is None or baseline.channels is None:
        raise ValueError("the self-check needs a record with converter codes and channels")
    return (
        _samples(baseline),
        *(_sensor(codes, channel) for codes, channel in _sensors(baseline)),
        *([_force_noise(float(np.std(baseline.force)), level)] if baseline.has_force else []),
        _response_noise(float(np.std(baseline.acceleration)), baseline.channels[-1]),
        _hum(baseline),
        _spindle(baseline),
        _disk(free_bytes),
    )


def calibration_check(channels: Sequence[Channel], interval_months: float) -> Check:
    """Sensitivities and calibration dates."""
    doubts = sensor_doubts(channels, datetime.now(UTC).date(), interval_months)
    return Check("calibration", not doubts, "; ".join(map(str, doubts)) or "dates known and not too old")


def sensor_doubts(channels: Sequence[Channel], today: date, interval_months: float) -> list[Remark]:
    """Sensitivities and ranges that are not believed, calibrations that are old, not known or of an impossible day."""
    doubts: list[Remark] = []
    for channel in channels:
        doubts += channel_doubts(channel)
        calibration = calibration_doubt(channel, today, interval_months)
        if calibration is not None:
            doubts.append(calibration)
    return doubts


def _samples(baseline: Hit) -> Check:
    lost = baseline.lost_scans
    text = f"{lost} scans lost in a second: lower the sample rate or use another cable or port" if lost else ""
    return Check("samples", not lost, text or f"come at {baseline.sample_rate:g} Hz, none lost")


def _sensors(baseline: Hit) -> Iterator[tuple[NDArray[np.int32], Channel]]:
    """Codes and channel of all that felt it, that across last."""
    if baseline.codes is not None and baseline.channels is not None:
        yield from zip(baseline.codes, baseline.channels, strict=True)
    if baseline.beside is not None:
        yield from list(_sensors(baseline.beside))[1:]


def _sensor(codes: NDArray[np.int32], channel: Channel) -> Check:
    name, low, high = f"{channel.name} sensor", *channel.rails_in(codes)
    stuck = np.mean((codes <= low) | (codes >= high))
    if stuck > 0.5:
        return Check(name, False, "stands at the end of its range: cable open or sensor not powered")
    if np.ptp(codes) == 0:
        return Check(name, False, f"stands still at {codes[0] * channel.scale:.3g}: cable shorted or not plugged in")
    return Check(name, True, "alive")


def _force_noise(rms: float, level: float | None) -> Check:
    if level is None or level >= LEVEL_NOISE_RATIO * rms:
        against = "" if level is None else f", trigger at {level:g} N"
        return Check("force noise", True, f"{rounded(rms, digits=2)} N rms{against}")
    cure = f"set trigger_n above {rounded(2 * LEVEL_NOISE_RATIO * rms, digits=2)}, or find the source of the noise"
    return Check("force noise", False, f"{rounded(rms, digits=2)} N rms is too near the trigger at {level:g} N: {cure}")


def _response_noise(rms: float, channel: Channel) -> Check:
    scale = channel.full_scale / abs(channel.sensitivity)
    text = f"{rounded(rms, digits=2)} m/s^2 rms"
    if rms < NOISE_SHARE * scale:
        return Check("response noise", True, text)
    cure = "is the machine at rest, the sensor fixed?"
    return Check("response noise", False, f"{text}, {100 * rms / scale:.2g} % of the range: {cure}")


def _spectrum(signal: NDArray[np.float64], rate: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Frequencies (Hz) and power of a Hann-windowed record; the sum of the power is its mean square."""
    window = np.hanning(signal.size)
    power = np.abs(np.fft.rfft((signal - np.mean(signal)) * window)) ** 2
    return np.arange(power.size) * rate / signal.size, 2 * power / (signal.size * np.sum(window**2))


def _near(frequency: NDArray[np.float64], line: float) -> NDArray[np.bool_]:
    """The lines that a Hann window spreads one frequency over."""
    return np.asarray(np.abs(frequency - line) <= 2 * frequency[1])


def _mains(frequency: NDArray[np.float64], mains: float) -> NDArray[np.bool_]:
    return np.asarray(np.any([_near(frequency, mains * k) for k in range(1, HARMONICS + 1)], axis=0))


def _hum(baseline: Hit) -> Check:
    """Mains lines in either channel."""
    texts = []
    for channel, signal, unit in _signals(baseline):
        frequency, power = _spectrum(signal, baseline.sample_rate)
        worst = max(MAINS, key=lambda mains: float(np.sum(power[_mains(frequency, mains)])))
        hum = float(np.sum(power[_mains(frequency, worst)]))
        if hum > HUM_SHARE * np.sum(power) and np.sqrt(hum) > FEWEST_CODES * abs(channel.scale):
            texts.append(f"{np.sqrt(hum):.2g} {unit} rms at {worst:g} Hz and its multiples in the {channel.quantity}")
    if texts:
        return Check("hum", False, f"{', '.join(texts)}: check cable shields and the ground")
    return Check("hum", True, "no mains hum")


def _spindle(baseline: Hit) -> Check:
    """One strong line in the response that is not of the mains."""
    channel, signal, unit = _signals(baseline)[-1]
    frequency, power = _spectrum(signal, baseline.sample_rate)
    off_mains = np.where(np.any([_mains(frequency, mains) for mains in MAINS], axis=0), 0.0, power)
    line = float(frequency[int(np.argmax(off_mains))])
    rms = float(np.sqrt(np.sum(off_mains[_near(frequency, line)])))
    if rms**2 > TURNING_SHARE * np.sum(power) and rms > FEWEST_CODES * abs(channel.scale):
        vibration = f"{rounded(rms, digits=2)} {unit} rms at {line:.0f} Hz ({60 * line:.0f} rpm)"
        return Check("spindle", False, f"a steady vibration of {vibration}: stop the spindle and what runs beside it")
    return Check("spindle", True, "no steady vibration")


def _signals(baseline: Hit) -> list[tuple[Channel, NDArray[np.float64], str]]:
    if baseline.channels is None:
        return []
    units = {"force": "N", "acceleration": "m/s^2"}
    pairs = zip(baseline.channels, baseline.signals, strict=True)
    return [(channel, signal, units[channel.quantity]) for channel, signal in pairs]


def _disk(free: int) -> Check:
    enough = free >= DISK_ROOM * RESERVE_BYTES
    return Check("disk", enough, f"{free / 1e9:.1f} GB free{'' if enough else ': make room soon'}")


def _part(record: Hit, start: int, end: int) -> Hit:
    if record.codes is None or record.channels is None:
        return Hit(record.force[start:end], record.acceleration[start:end], record.sample_rate)
    part, beside = record.codes[:, start:end], None if record.beside is None else _part(record.beside, start, end)
    return Hit.from_codes(part, record.channels, record.sample_rate, 0, record.lost_scans, beside=beside)
