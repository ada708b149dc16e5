"""Resolve the hits in the contents of a recorded file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from decimal import Decimal

import numpy as np

from acquisition.arrays import Floats
from acquisition.files.contents.column_headings import format_signal_names
from acquisition.files.contents.contents import Contents, Signal, cut_to_shortest, report_flaws
from acquisition.files.contents.description import Description, Fact, ImportReport
from acquisition.files.contents.resolve_unit import (
    MOTION_QUANTITIES,
    choose_signal,
    convert_to_sensor_units,
    resolve_force_unit,
    resolve_response_unit,
)
from acquisition.files.contents.units import STANDARD_GRAVITY, parse_unit
from acquisition.hit import Hit
from acquisition.hit_quality.overload_and_hum import find_overload
from acquisition.hits.capture_hits import split_record

MAX_TIME_DEVIATION = 0.05
"""Largest distance of a time from an even axis that is taken, in steps: 9 degrees of phase at half the sample rate.

Seven printed digits at 51.2 kHz are off by 0.003, single precision by 0.012 after 4 s, a lost sample by 0.5 or more."""
MIN_UNEVEN_STEPS = 20
"""Steps that are uneven, at least, where few digits are the reason; a lost sample makes one so."""


def measure_step(time: Floats) -> tuple[float, str]:
    """The step of an even axis, and what is wrong with it; the text is empty where nothing is."""
    if time.size < 2 or not np.all(np.isfinite(time)):
        return 0.0, "its time is no row of finite numbers"
    step = float(time[-1] - time[0]) / (time.size - 1)
    if step <= 0:
        return 0.0, f"its time does not rise (from {time[0]:g} to {time[-1]:g}); sort its rows"
    beside = (time - time[0]) / step - np.arange(time.size)
    away = np.abs(beside - (beside.max() + beside.min()) / 2)
    worst = int(np.argmax(away))
    if away[worst] <= MAX_TIME_DEVIATION:
        return step, ""
    return step, (
        f"its time steps are uneven: sample {worst + 1} is {away[worst]:.2g} steps off an even axis, {MAX_TIME_DEVIATION:g} are "
        "taken (are samples missing, twice there, or not in order?)"
    )


def infer_printed_step(time: Floats) -> float | None:
    """The step of an even axis that was printed with few digits: each time lies within half its last one of it.

    None where no even axis is printed so, or where the steps are uneven in a few places only.
    """
    step = float(time[-1] - time[0]) / (time.size - 1)
    if np.sum(np.abs(np.diff(time) / step - 1) > MAX_TIME_DEVIATION) < MIN_UNEVEN_STEPS:
        return None
    half = 0.5 * np.array([10.0 ** _get_last_digit_exponent(value) for value in time[1:].tolist()]) * (1 + 1e-6)
    count = np.arange(1, time.size)
    least = float(np.max((time[1:] - half - time[0]) / count))
    most = float(np.min((time[1:] + half - time[0]) / count))
    return (least + most) / 2 if 0 < least <= most else None


def _get_last_digit_exponent(value: float) -> int:
    """Power of ten of the last digit of a number."""
    exponent = Decimal(repr(value)).normalize().as_tuple().exponent
    return exponent if isinstance(exponent, int) else 0


def make_hit_from_motion(force: Floats, response: Floats, rate: float, quantity: str) -> Hit:
    """A hit from its force (N) and a response in SI of this quantity; an overload is looked for in what was recorded.

    Differentiated in the frequency domain, times 2 pi i f: the FRF is that of the recorded motion to rounding, as all
    that follows divides again. ValueError as of a hit.
    """
    recorded = Hit(force, response, rate)
    order = len(MOTION_QUANTITIES) - 1 - MOTION_QUANTITIES.index(quantity)
    if not order:
        return recorded
    spectrum = np.fft.rfft(recorded.acceleration - np.mean(recorded.acceleration))
    spectrum *= (2j * np.pi * np.fft.rfftfreq(recorded.acceleration.size, 1 / rate)) ** order
    acceleration = np.fft.irfft(spectrum, recorded.acceleration.size)
    return Hit(recorded.force, acceleration, rate, overload=2 if find_overload(recorded, 1) else 0)


HIT_COLUMNS_EXAMPLE = '--columns "time [s],force [N],acceleration [g]", in their order, or each with =NAME'
"""How hits are named."""
NO_FORCE_ADVICE = "hammer none where no force was measured"
"""What is said where there is no force."""
FEW_DIGITS_FACT = Fact(
    "note", "its time is printed with few digits: whether samples are missing cannot be seen", "file"
)
MAX_RATE_DIFFERENCE = 1e-4
"""Relative difference of two sample rates that are taken for one: that of a rate with five digits."""


def resolve_hits(contents: Contents, description: Description, report: ImportReport) -> list[Hit]:
    """Those of each record; empty where something is missing or wrong, which the report then says."""
    hits = list[Hit]()
    for record in dict.fromkeys(signal.record for signal in contents.signals):
        of_one = ImportReport()
        hit = _resolve_hit([signal for signal in contents.signals if signal.record == record], description, of_one)
        if not of_one.is_clean or hit is None:
            report.merge(replace(of_one, facts=[]))
            return []
        report.facts += of_one.facts if not hits else []
        parts = split_record(hit)
        if len(parts) > 1:
            report.add_fact("hits", f"{len(parts)} in one record, each of {parts[0].acceleration.size} samples")
        hits += parts
    return hits


def _resolve_hit(signals: Sequence[Signal], description: Description, report: ImportReport) -> Hit | None:
    scaled = convert_to_sensor_units(apply_full_scale(signals, description, report), description, report)
    if scaled is None:
        if sum(signal.role != "time" for signal in signals) > 2 and description.response is None:
            report.add_missing("which of its responses is meant", "--response 1")
        resolve_rate(signals, (), description, report)
        return None
    signals = scaled
    forces, responses = _split_by_kind(signals, description, report)
    choice = ImportReport()
    response = choose_signal(responses, description.response, "responses", choice) if responses else None
    rate, used = resolve_rate(signals, [*forces, *([response] if response else [])], description, report)
    report.merge(choice)
    forces, response = (used[:-1], used[-1]) if response else (forces, None)
    force = _resolve_force(forces, description, report)
    unit = resolve_response_unit(response or responses[0], description, report) if responses else None
    _check_gravity_offset([response] if response else responses, report)
    if force is None or response is None or unit is None or not report.is_clean:
        return None
    try:
        hit = make_hit_from_motion(force, response.values * unit[1], rate, unit[0])
    except ValueError as error:
        report.faults.append(str(error))
        return None
    if unit[0] != "acceleration":
        report.add_fact("note", f"its {unit[0]} is differentiated")
    return hit


def _resolve_force(forces: Sequence[Signal], description: Description, report: ImportReport) -> Floats | None:
    """Force (N), empty where none was measured; None where it is missing, or its unit."""
    if description.without_force:
        return np.empty(0)
    if len(forces) != 1:
        return None
    to_newton = resolve_force_unit(forces[0], description, report)
    return None if to_newton is None else np.asarray(forces[0].values * to_newton)


def _split_by_kind(
    signals: Sequence[Signal], description: Description, report: ImportReport
) -> tuple[list[Signal], list[Signal]]:
    """Forces and responses; what neither unit nor name tells is asked about."""
    needs_force = not description.without_force
    forces = [signal for signal in signals if needs_force and infer_kind(signal) == "force"]
    responses = [signal for signal in signals if infer_kind(signal) == "response"]
    unclear = [channel for channel in signals if not infer_kind(channel) and channel.role in ("", "real", "magnitude")]
    channels = [channel for channel in signals if channel.role != "time"]
    names = format_signal_names(channels)
    if len(channels) < 1 + needs_force:
        report.faults.append(
            f"it holds {names or 'nothing'} over time; a hit needs "
            + (f"a force and a response (--force FILE; {NO_FORCE_ADVICE})" if needs_force else "a response")
        )
        return [], []
    if unclear and ((needs_force and not forces) or not responses):
        report.add_missing(f"what its columns are ({format_signal_names(signals)})", HIT_COLUMNS_EXAMPLE)
        return forces, responses
    if needs_force and not forces:
        report.faults.append(f"no force channel among {names}; one is needed ({NO_FORCE_ADVICE})")
    if needs_force and len(forces) > 1:
        report.add_missing(
            f"which force of {format_signal_names(forces)} goes with which response", HIT_COLUMNS_EXAMPLE
        )
    if not responses:
        report.faults.append(f"no channel of a response among {names}")
    return forces, responses


def infer_kind(signal: Signal) -> str:
    """force or response by the role or the unit; empty where neither tells."""
    unit = parse_unit(signal.unit) if signal.unit else None
    quantity = signal.quantity or (unit.quantity if unit else "")
    by_quantity = "response" if quantity in MOTION_QUANTITIES else quantity if quantity == "force" else ""
    return by_quantity or (signal.role if signal.role in ("force", "response") else "")


def resolve_rate(
    signals: Sequence[Signal], used: Sequence[Signal], description: Description, report: ImportReport
) -> tuple[float, list[Signal]]:
    """Samples a second (Hz), 0 where that is missing or wrong; and the signals that are used, in one length."""
    times = [signal for signal in signals if signal.role == "time"]
    used, times = cut_to_shortest(used, times, report)
    of_one_length = used or [signal for signal in signals if signal.values.size == signals[0].values.size]
    if len({signal.values.size for signal in of_one_length}) > 1:
        report.faults.append(f"its channels differ in length: {format_signal_names(of_one_length)}")
        return 0.0, used
    rates = [signal.rate for signal in of_one_length if signal.rate is not None]
    if rates and max(rates) > min(rates) * (1 + MAX_RATE_DIFFERENCE):
        report.faults.append(f"its channels differ in sample rate: {min(rates):g} and {max(rates):g} Hz")
        return 0.0, used
    size = of_one_length[0].values.size
    beside = [time for time in times if time.values.size == size]
    report_flaws([*used, *beside], report)
    by_axis = _compute_rate_from_time(beside, report)
    return _agree_on_rate(rates[0] if rates else by_axis, description.rate, report), used


def _compute_rate_from_time(times: Sequence[Signal], report: ImportReport) -> float | None:
    """That of the time columns, which must agree; None where there is none whose unit is known."""
    if not times or any(time.flaws for time in times):
        return None
    size = times[0].values.size
    if size < 8:
        report.faults.append(f"{size} samples; at least 8 are needed")
        return None
    steps = [_resolve_step(np.asarray(time.values, dtype=np.float64), report) for time in times]
    if not all(steps):
        return None
    starts = [time.values[0] for time in times]
    if np.ptp(starts) > MAX_TIME_DEVIATION * steps[0] or np.ptp(steps) * size > steps[0]:
        report.faults.append(f"its time axes differ: they begin at {starts} with steps of {steps}")
        return None
    unit = parse_unit(times[0].unit)
    if unit is None or unit.quantity != "time":
        return None
    return 1 / (steps[0] * unit.factor)


def _resolve_step(time: Floats, report: ImportReport) -> float:
    """Of an even axis; 0 where it is none, which the report then says."""
    step, fault = measure_step(time)
    if not fault:
        return step
    printed = infer_printed_step(time) if step > 0 else None
    if printed is None:
        report.faults.append(f"{fault}; where the time alone is wrong leave it out of --columns and give --rate")
        return 0.0
    if FEW_DIGITS_FACT not in report.facts:
        report.facts.append(FEW_DIGITS_FACT)
    return printed


def _agree_on_rate(in_file: float | None, given: float | None, report: ImportReport) -> float:
    if given is not None and not (np.isfinite(given) and given > 0):
        report.faults.append(f"--rate {given:g}: give the samples a second, > 0 Hz")
        return 0.0
    if in_file is not None and given is not None and abs(given / in_file - 1) > 0.01:
        report.add_contradiction("--rate", f"{given:g}", f"{in_file:g} Hz")
        return 0.0
    if in_file is not None:
        report.add_fact("sample rate", f"{in_file:.8g} Hz")
        return in_file
    if given is not None:
        report.add_fact("sample rate", f"{given:.8g} Hz", "option")
        return given
    if not report.faults:
        report.add_missing("its sample rate, or the unit of its time", "--rate 51200")
    return 0.0


def _check_gravity_offset(responses: Sequence[Signal], report: ImportReport) -> None:
    """A resting sensor that shows 9.8 in a column called g holds m/s^2."""
    for signal in responses:
        offset = abs(float(np.median(signal.values))) if signal.values.size else 0.0
        if signal.unit.lower() == "g" and abs(offset - STANDARD_GRAVITY) < 0.5:
            report.faults.append(
                f"unit of {signal.name} in doubt (called g, rests at {offset:.2f}, which is gravity in m/s^2)"
            )


def apply_full_scale(signals: Sequence[Signal], description: Description, report: ImportReport) -> list[Signal]:
    """Values that are shares of a full scale, in their unit."""
    shares = [signal for signal in signals if signal.per_full_scale]
    if not shares:
        if description.full_scale:
            report.faults.append("--full-scale: its values are no shares of a full scale; leave it out")
        return list(signals)
    if len(description.full_scale) != len(shares):
        report.add_missing(
            f"the full scale of its {len(shares)} channels, in their order and units", "--full-scale 500,50"
        )
        return list(signals)
    report.add_fact("full scale", ", ".join(f"{factor:g}" for factor in description.full_scale), "option")
    scale = dict(zip((id(signal) for signal in shares), description.full_scale, strict=True))
    return [replace(signal, values=signal.values * scale.get(id(signal), 1.0)) for signal in signals]
