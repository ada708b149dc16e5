"""Check sensors, noise, hum and detectable band before the first hit."""

import math
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime

import numpy as np

from acquisition import Channel, DataError, Hit, Remark, calibration_remark, channel_remarks
from acquisition.arrays import Codes
from acquisition.errors import join_sentences
from dsm import format_rounded, natural_frequencies
from lobewatch.arrays import Floats
from lobewatch.machine import Machine
from lobewatch.machine.folder_lock import RESERVE_BYTES
from lobewatch.measurement.sensor_effects import MAX_DECAY_FREQUENCY_RATIO
from lobewatch.tap.state import Check
from lobewatch.tap.steady_line import (
    MIN_HUM_CODES,
    MIN_LINE_POWER_SHARE,
    compute_power_spectrum,
    find_steady_line,
    measure_hum,
)
from lobewatch.tap.trial_hits import CHANNEL_UNITS

QUIET_PIECE_TIME = 0.01
"""Length of the pieces by which a quiet part is found (s)."""
QUIET_RMS_FACTOR = 3.0
"""Largest rms of a quiet piece over that of the quietest fifth."""
MIN_QUIET_TIME = 0.1
"""Shortest quiet part (s)."""
MIN_TRIGGER_NOISE_RATIO = 6.0
"""Smallest trigger level over the rms of the force at rest."""
MAX_RESPONSE_NOISE_SHARE = 0.02
"""Largest noise of the response as a share of its range."""
MIN_DISK_RESERVES = 4
"""Free disk space over that reserved by a test, at least, chosen."""
SENSOR_ERROR_CODES = frozenset({"calibration-no-date", "calibration-in-future", "sample-rate-wrong"})
"""Codes of impossible values that must be corrected before a sensor or DAQ is used."""


def find_quiet_part(record: Hit) -> Hit:
    """Return the longest part of a record without hits and their decay, or all of it if no part is quiet."""
    size = max(round(QUIET_PIECE_TIME * record.sample_rate), 1)
    count = record.acceleration.size // size
    if count < 2:
        return record
    rms = np.std(record.signals[:, : count * size].reshape(-1, count, size), axis=2)
    floor = np.quantile(rms, 0.2, axis=1, keepdims=True)
    quiet = np.concatenate(([0], np.all(rms <= QUIET_RMS_FACTOR * floor, axis=0).astype(np.int8), [0]))
    starts, ends = np.flatnonzero(np.diff(quiet) == 1), np.flatnonzero(np.diff(quiet) == -1)
    if not starts.size or np.max(ends - starts) * QUIET_PIECE_TIME < MIN_QUIET_TIME:
        return record
    best = int(np.argmax(ends - starts))
    return slice_record(record, int(starts[best]) * size, int(ends[best]) * size)


def run_self_check(baseline: Hit, level: float | None, free_bytes: int) -> tuple[Check, ...]:
    """Check samples, sensors, noise, hum, spindle and disk, one line each.

    baseline: a record of a DAQ without hits. level: trigger level (N), None if trial hits choose it.
    """
    if baseline.codes is None or baseline.channels is None:
        raise ValueError("the self-check needs a record with converter codes and channels")
    return (
        _check_samples(baseline),
        *(_check_sensor(codes, channel) for codes, channel in _iterate_sensors(baseline)),
        *([_check_force_noise(float(np.std(baseline.force)), level)] if baseline.has_force else []),
        _check_response_noise(float(np.std(baseline.acceleration)), baseline.channels[-1]),
        _check_hum(baseline),
        _check_spindle(baseline),
        _check_disk(free_bytes),
    )


def check_calibration(channels: Sequence[Channel], interval_months: float) -> Check:
    """Check sensitivities and calibration dates."""
    remarks = sensor_remarks(channels, interval_months)
    return Check(
        "calibration", not remarks, join_sentences(*map(str, remarks)) or "all sensitivities known and up to date"
    )


def sensor_remarks(channels: Sequence[Channel], interval_months: float) -> list[Remark]:
    """Return remarks on implausible sensitivities and ranges and on old, unknown or impossible calibrations."""
    remarks, today = list[Remark](), datetime.now(UTC).date()
    for channel in channels:
        remarks += [*channel_remarks(channel), *filter(None, [calibration_remark(channel, today, interval_months)])]
    return remarks


def _check_samples(baseline: Hit) -> Check:
    lost = baseline.lost_scans
    if not lost:
        return Check("samples", True, f"{baseline.sample_rate:g} Hz, no samples lost")
    cure = "Lower the sample rate or use another cable or port"
    return Check("samples", False, join_sentences(f"{lost} samples per channel lost in one second", cure))


def _iterate_sensors(baseline: Hit) -> Iterator[tuple[Codes, Channel]]:
    """Yield codes and channel of all sensors, the cross sensor last."""
    if baseline.codes is not None and baseline.channels is not None:
        yield from zip(baseline.codes, baseline.channels, strict=True)
    if baseline.cross_hit is not None:
        yield from list(_iterate_sensors(baseline.cross_hit))[1:]


def _check_sensor(codes: Codes, channel: Channel) -> Check:
    name, low, high = f"{channel.name} sensor", *channel.effective_rails(codes)
    if np.mean((codes <= low) | (codes >= high)) > 0.5:
        return Check(name, False, "signal at the limit of the input range. Check the cable and the power supply.")
    if np.ptp(codes) == 0:
        return Check(name, False, f"constant signal of {codes[0] * channel.scale:.3g}. Check the cable and its plugs.")
    return Check(name, True, "OK")


def _check_force_noise(rms: float, level: float | None) -> Check:
    if level is None or level >= MIN_TRIGGER_NOISE_RATIO * rms:
        against = "" if level is None else f", trigger at {level:g} N"
        return Check("force noise", True, f"{format_rounded(rms, digits=2)} N rms{against}")
    amplitude = format_rounded(2 * MIN_TRIGGER_NOISE_RATIO * rms, digits=2)
    cure = f"Set trigger_n above {amplitude} N, or find the source of the noise"
    text = f"{format_rounded(rms, digits=2)} N rms of noise is too close to the trigger at {level:g} N"
    return Check("force noise", False, join_sentences(text, cure))


def _check_response_noise(rms: float, channel: Channel) -> Check:
    scale = channel.full_scale / abs(channel.sensitivity)
    text = f"{format_rounded(rms, digits=2)} m/s^2 rms"
    if rms < MAX_RESPONSE_NOISE_SHARE * scale:
        return Check("response noise", True, text)
    cure = "Stop the machine and check that the sensor is fixed"
    return Check("response noise", False, join_sentences(f"{text}, {100 * rms / scale:.2g} % of the range", cure))


def _check_hum(baseline: Hit) -> Check:
    """Check for mains lines in each channel."""
    texts = dict[str, str]()
    for channel, signal, unit in _list_signals(baseline):
        frequency, power = compute_power_spectrum(signal, baseline.sample_rate)
        hum, mains = measure_hum(frequency, power)
        if hum**2 > MIN_LINE_POWER_SHARE * np.sum(power) and hum > MIN_HUM_CODES * abs(channel.scale):
            name = channel.quantity
            texts[name] = f"{hum:.2g} {unit} rms at {mains:g} Hz and harmonics in the {name} signal"
    if not texts:
        return Check("hum", True, "no mains hum")
    still = "Check that the spindle stands still" if "acceleration" in texts else ""
    return Check("hum", False, join_sentences(", ".join(texts.values()), still, "Check cable shields and grounding"))


def _check_spindle(baseline: Hit) -> Check:
    """Check for a strong line in the response that weak mains hum does not explain."""
    line = find_steady_line(baseline)
    if line is None or not line.is_asked:
        return Check("spindle", True, "no steady vibration")
    return Check("spindle", False, line.text)


def _list_signals(baseline: Hit) -> list[tuple[Channel, Floats, str]]:
    pairs = zip(baseline.channels or (), baseline.signals, strict=True)
    return [(channel, signal, CHANNEL_UNITS[channel.quantity]) for channel, signal in pairs]


def _check_disk(free: int) -> Check:
    enough = free >= MIN_DISK_RESERVES * RESERVE_BYTES
    return Check("disk", enough, join_sentences(f"{free / 1e9:.1f} GB free", "" if enough else "Make room soon"))


def slice_record(record: Hit, start: int, end: int) -> Hit:
    """Return the samples of a record from one number to another."""
    if record.codes is None or record.channels is None:
        return Hit(record.force[start:end], record.acceleration[start:end], record.sample_rate)
    part = record.codes[:, start:end]
    beside = None if record.cross_hit is None else slice_record(record.cross_hit, start, end)
    return Hit.from_codes(part, record.channels, record.sample_rate, lost_scans=record.lost_scans, cross_hit=beside)


REFERENCE_HITS = 10
"""Number of hits for which the error is stated."""
TARGET_FREQUENCY_ERROR = 1e-3
"""Relative standard error of f_n that such a test should reach, a third of its usual scatter."""
FIT_ERROR_FACTOR = 2.0
"""Error of the fit with residual terms over the smallest possible one, 1.3 to 2.2 in simulations."""
ASSUMED_DAMPING_RATIO = 0.03
"""Damping ratio assumed without a model."""


def check_detectable_band(baseline: Hit, machine: Machine, tool: str) -> Check:
    """Compare band and noise of the sensor with the followed mode, if the model or [mode] band_hz gives it.

    baseline: a record at rest.
    """
    rate, band = baseline.sample_rate, machine.tap.sensor_band_hz or math.inf
    highest, noise = min(MAX_DECAY_FREQUENCY_RATIO * rate, band), float(np.std(baseline.acceleration))
    detectable = f"modes up to {highest:.0f} Hz are detectable"
    with_noise = f"{detectable}, noise {format_rounded(noise, digits=2)} m/s^2 rms"
    frequency, where = _find_expected_frequency(machine, tool)
    damping_ratio = float(machine.spindle.damping_ratio) if machine.spindle else ASSUMED_DAMPING_RATIO
    if frequency is None:
        text = join_sentences(with_noise, "The mode frequency of this machine is unknown")
        return Check("band", True, text, is_notable=True)
    if frequency > highest:
        cure = "Use a faster sensor or a higher sample rate"
        return Check(
            "band", False, join_sentences(f"{detectable}, but not the mode at {frequency:.0f} Hz ({where})", cure)
        )
    amplitude = min_decay_amplitude(frequency, damping_ratio, noise / math.sqrt(min(rate / 2, band)))
    hits = f"{REFERENCE_HITS} hits with a response of {format_rounded(amplitude, digits=2)} m/s^2"
    error = f"{hits} give the mode at {frequency:.0f} Hz ({where}) to within {100 * TARGET_FREQUENCY_ERROR:g} %"
    return Check("band", True, join_sentences(with_noise, error), is_notable=True)


def min_decay_amplitude(frequency: float, damping_ratio: float, density: float) -> float:
    """Return the amplitude (m/s^2) of ten free decays whose frequency white noise leaves known to the target.

    density: of the noise (m/s^2 per square root of Hz), its rms over the square root of the band that it fills.
    FIT_ERROR_FACTOR times the Cramer-Rao bound of A exp(-a t) cos(w t + phase) in noise of density n:
    var(w) = 8 n^2 a^3 / A^2.
    Source: Kay, Fundamentals of Statistical Signal Processing (1993), ch. 3, for this signal.
    """
    decay = damping_ratio * 2 * math.pi * frequency
    bound = density * math.sqrt(8 * decay**3 / REFERENCE_HITS)
    return FIT_ERROR_FACTOR * bound / (TARGET_FREQUENCY_ERROR * 2 * math.pi * frequency)


def _find_expected_frequency(machine: Machine, tool: str) -> tuple[float | None, str]:
    """Return the frequency of the followed mode (Hz) and its source."""
    try:
        spindle = machine.model(tool)
    except (DataError, ValueError):
        band = machine.mode.band_hz
        return (None, "") if band is None else (band[1], "upper end of [mode] band_hz")
    return float(natural_frequencies(spindle, machine.mode.model_mode)[-1]), "spindle model"
