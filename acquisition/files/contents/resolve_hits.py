"""Resolve the hits in the contents of a recorded file."""

from collections.abc import Sequence
from dataclasses import replace
from decimal import Decimal

import numpy as np

from acquisition.arrays import Floats
from acquisition.files.contents import resolve_unit
from acquisition.files.contents.column_headings import format_signal_names
from acquisition.files.contents.contents import Contents, ImportReport, Signal, UnresolvedError, cut_to_shortest
from acquisition.files.contents.join_hits import MAX_RATE_DIFFERENCE, join_hits, make_left_out_remark
from acquisition.files.contents.units import MOTION_QUANTITIES, STANDARD_GRAVITY, parse_unit
from acquisition.hit import MIN_SAMPLES, Hit
from acquisition.hit_quality.overload_and_hum import find_overload
from acquisition.hits.capture_hits import split_record

HIT_COLUMNS_EXAMPLE = ' "time [s],force [N],acceleration [g]"'
"""Example of the columns of hits."""
NO_FORCE_ADVICE = 'If no force was measured, set hammer = "none" in [tap], or use fit_file_modes.hammer none'
"""Advice for a file without a force."""
FEW_DIGITS = "the times in the file have few digits, so missing samples cannot be detected"
"""Note on a time that cannot show missing samples."""
MAX_TIME_DEVIATION = 0.05
"""Largest distance of a time from an even axis, in steps: 9 degrees of phase at half the sample rate.

Seven printed digits at 51.2 kHz are off by 0.003, single precision by 0.012 after 4 s, a lost sample by 0.5 or more.
"""
MIN_UNEVEN_STEPS = 20
"""Smallest number of uneven steps where few digits are the reason; a lost sample makes one."""


def resolve_hits(contents: Contents, report: ImportReport) -> list[Hit]:
    """Return the hits of each record; empty if the report has faults or missing facts."""
    hits = list[Hit]()
    for record in dict.fromkeys(signal.record for signal in contents.signals):
        record_report = ImportReport(report.description)
        signals = [signal for signal in contents.signals if signal.record == record]
        hit = record_report.attempt(_resolve_hit, signals)
        if hit is None:
            report.merge(replace(record_report, facts=[]))
            return []
        if not hits:
            report.facts += record_report.facts
            report.units += record_report.units
        parts = split_record(hit)
        if len(parts) > 1:
            report.add_fact("hits", f"{len(parts)} in one record, {parts[0].acceleration.size} samples per hit")
        hits += parts
    return hits


def resolve_test(found: Sequence[tuple[Sequence[Signal], ImportReport]], report: ImportReport) -> list[Hit]:
    """Return the hits of one tap test; each one that cannot be used gets a remark unless it is all."""
    hits, broken = dict[str, Hit](), dict[str, ImportReport]()
    for signals, hit_report in found:
        hit = hit_report.attempt(_resolve_hit, signals) if hit_report.is_clean else None
        for part in [None] if hit is None else split_record(hit):
            place = f"hit {len(hits) + len(broken) + 1}"
            if part is None:
                broken[place] = hit_report
            else:
                report.facts += hit_report.facts if not hits else []
                report.units += hit_report.units if not hits else []
                hits[place] = part
    if not hits:
        report.merge(replace(next(iter(broken.values())), facts=[]))
        return []
    joined, remarks = join_hits(hits)
    report.remarks += [make_left_out_remark(place, fault.format_problems()) for place, fault in broken.items()]
    report.remarks += remarks
    report.add_fact(
        "hits", f"{len(joined)} of {len(hits) + len(broken)}, {joined[0].acceleration.size} samples per hit"
    )
    return joined


def _resolve_hit(signals: Sequence[Signal], report: ImportReport) -> Hit:
    scaled = report.attempt(resolve_unit.convert_to_sensor_units, apply_full_scale(signals, report))
    if scaled is None:
        if sum(signal.role != "time" for signal in signals) > 2 and report.description.response is None:
            report.add_missing("number of the response channel", "response", " 1")
        resolve_rate(signals, (), report)
        raise UnresolvedError
    forces, responses = _split_by_kind(scaled, report)
    choice = ImportReport(report.description)
    response = choice.attempt(resolve_unit.choose_signal, responses, "responses") if responses else None
    rate, used = resolve_rate(scaled, [*forces, *([response] if response else [])], report)
    report.merge(choice)
    forces, response = (used[:-1], used[-1]) if response else (forces, None)
    force = _resolve_force(forces, report)
    unit = report.attempt(resolve_unit.resolve_response_unit, response or responses[0]) if responses else None
    _check_gravity_offset([response] if response else responses, report)
    if force is None or response is None or unit is None or not report.is_clean:
        raise UnresolvedError
    try:
        hit = make_hit_from_motion(force, response.values * unit[1], rate, unit[0])
    except ValueError as error:
        raise report.add_fault(str(error)) from error
    if unit[0] != "acceleration":
        report.add_fact("note", f"acceleration computed from the {unit[0]}")
    return hit


def make_hit_from_motion(force: Floats, response: Floats, rate: float, quantity: str) -> Hit:
    """Make a hit from its force (N) and a response in SI units of any motion quantity.

    The response is differentiated in the frequency domain, times 2 pi i f: the FRF is that of the recorded motion to
    rounding, as later steps divide again. An overload is looked for in the recorded motion.
    """
    recorded = Hit(force, response, rate)
    order = len(MOTION_QUANTITIES) - 1 - MOTION_QUANTITIES.index(quantity)
    if not order:
        return recorded
    spectrum = np.fft.rfft(recorded.acceleration - np.mean(recorded.acceleration))
    spectrum *= (2j * np.pi * np.fft.rfftfreq(recorded.acceleration.size, 1 / rate)) ** order
    acceleration = np.fft.irfft(spectrum, recorded.acceleration.size)
    return Hit(recorded.force, acceleration, rate, overload=2 if find_overload(recorded, 1) else 0)


def _resolve_force(forces: Sequence[Signal], report: ImportReport) -> Floats | None:
    """Return the force (N), empty if none was measured; None if it or its unit is missing."""
    if report.description.without_force:
        return np.empty(0)
    to_newton = report.attempt(resolve_unit.resolve_force_unit, forces[0]) if len(forces) == 1 else None
    return None if to_newton is None else np.asarray(forces[0].values * to_newton)


def _split_by_kind(signals: Sequence[Signal], report: ImportReport) -> tuple[list[Signal], list[Signal]]:
    """Return forces and responses, and report channels whose kind neither unit nor name shows."""
    needs_force = not report.description.without_force
    forces = [signal for signal in signals if needs_force and infer_kind(signal) == "force"]
    responses = [signal for signal in signals if infer_kind(signal) == "response"]
    unclear = [channel for channel in signals if not infer_kind(channel) and channel.role in ("", "real", "magnitude")]
    channels = [channel for channel in signals if channel.role != "time"]
    names = format_signal_names(channels)
    if len(channels) < 1 + needs_force:
        needed = "a force and a response" if needs_force else "a response"
        cure = f"Name the file of the force with Description.force. {NO_FORCE_ADVICE}" if needs_force else ""
        report.add_fault(f"a hit needs {needed}, but the file has {names or 'no signals'} over time", cure)
        return [], []
    if unclear and ((needs_force and not forces) or not responses):
        report.add_missing(f"meaning of the columns {format_signal_names(signals)}", "columns", HIT_COLUMNS_EXAMPLE)
        return forces, responses
    if needs_force and not forces:
        report.add_fault(f"no force channel among {names}", NO_FORCE_ADVICE)
    if needs_force and len(forces) > 1:
        fact = f"choice of one force channel ({format_signal_names(forces)})"
        report.add_missing(fact, "columns", HIT_COLUMNS_EXAMPLE)
    if not responses:
        report.add_fault(f"no response channel among {names}")
    return forces, responses


def infer_kind(signal: Signal) -> str:
    """Return "force" or "response" by the unit or the role; empty if neither shows it."""
    unit = parse_unit(signal.unit) if signal.unit else None
    quantity = signal.quantity or (unit.quantity if unit else "")
    if quantity in (*MOTION_QUANTITIES, "force"):
        return "force" if quantity == "force" else "response"
    return signal.role if signal.role in ("force", "response") else ""


def resolve_rate(signals: Sequence[Signal], used: Sequence[Signal], report: ImportReport) -> tuple[float, list[Signal]]:
    """Return the sample rate (Hz), 0 where it is missing or wrong, and the used signals in one length."""
    times = [signal for signal in signals if signal.role == "time"]
    used, times = cut_to_shortest(used, times, report)
    of_one_length = used or [signal for signal in signals if signal.values.size == signals[0].values.size]
    sizes = {signal.values.size for signal in of_one_length}
    if len(sizes) > 1:
        report.add_fault(f"the channels differ in number of samples ({format_signal_names(of_one_length)})")
        return 0.0, used
    rates = [signal.rate for signal in of_one_length if signal.rate is not None]
    if rates and max(rates) > min(rates) * (1 + MAX_RATE_DIFFERENCE):
        report.add_fault(f"the channels differ in sample rate ({min(rates):g} and {max(rates):g} Hz)")
        return 0.0, used
    times = [time for time in times if time.values.size in sizes]
    report.add_flaws([*used, *times])
    if sizes and min(sizes) < MIN_SAMPLES:
        report.add_fault(f"{min(sizes)} samples are too few. Record at least {MIN_SAMPLES} samples")
        return 0.0, used
    by_axis = _compute_rate_from_time(times, report)
    return _agree_on_rate(rates[0] if rates else by_axis, report), used


def _compute_rate_from_time(times: Sequence[Signal], report: ImportReport) -> float | None:
    """Return the rate of the time columns, which must agree; None without one whose unit is known."""
    if not times or any(time.flaws for time in times):
        return None
    steps = [_resolve_step(np.asarray(time.values, dtype=np.float64), report) for time in times]
    if not all(steps):
        return None
    starts = [time.values[0] for time in times]
    if np.ptp(starts) > MAX_TIME_DEVIATION * steps[0] or np.ptp(steps) * times[0].values.size > steps[0]:
        begin, step = (" and ".join(f"{value:.6g}" for value in values) for values in (starts, steps))
        report.add_fault(f"the time columns differ (start {begin}, step {step})")
        return None
    unit = parse_unit(times[0].unit)
    return 1 / (steps[0] * unit.factor) if unit is not None and unit.quantity == "time" else None


def _resolve_step(time: Floats, report: ImportReport) -> float:
    """Return the step of an even axis; 0 if it is uneven, with a fault in the report."""
    step, fault = measure_step(time)
    if not fault:
        return step
    printed = infer_printed_step(time) if step > 0 else None
    if printed is None:
        remedy = "If only the time is wrong, omit the time column from Description.columns and give Description.rate"
        report.add_fault(fault, remedy)
        return 0.0
    if not any(fact.value == FEW_DIGITS for fact in report.facts):
        report.add_fact("note", FEW_DIGITS)
    return printed


def measure_step(time: Floats) -> tuple[float, str]:
    """Return the step of an even axis and its fault, empty if there is none.

    The axis is evaluated as a whole, because single steps of a printed time are never quite the same.
    """
    if time.size < 2 or not np.all(np.isfinite(time)):
        return 0.0, "the time column has empty or infinite values"
    step = float(time[-1] - time[0]) / (time.size - 1)
    if step <= 0:
        return 0.0, f"the time does not increase (from {time[0]:g} to {time[-1]:g}). Sort the rows by time"
    deviation = (time - time[0]) / step - np.arange(time.size)
    distance = np.abs(deviation - (deviation.max() + deviation.min()) / 2)
    worst = int(np.argmax(distance))
    if distance[worst] <= MAX_TIME_DEVIATION:
        return step, ""
    place = f"sample {worst + 1} is {distance[worst]:.2g} steps from an even time axis (limit {MAX_TIME_DEVIATION:g})"
    return step, f"the time steps are uneven: {place}. Samples may be missing, repeated or out of order"


def infer_printed_step(time: Floats) -> float | None:
    """Return the step of an even axis that was printed with few digits; each time is within half its last digit.

    None if no even axis gives these digits, or if the steps are uneven in a few places only.
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
    exponent = Decimal(repr(value)).normalize().as_tuple().exponent
    return exponent if isinstance(exponent, int) else 0


def _agree_on_rate(in_file: float | None, report: ImportReport) -> float:
    given = report.description.rate
    if given is not None and not (np.isfinite(given) and given > 0):
        report.reject("rate", f"{given:g}", "the sample rate must be above 0 Hz")
    elif in_file is not None and given is not None and abs(given / in_file - 1) > 0.01:
        report.add_contradiction("rate", f"{given:g}", f"{in_file:g} Hz")
    elif (rate := given if in_file is None else in_file) is not None:
        report.add_fact("sample rate", f"{rate:.8g} Hz", "option" if in_file is None else "file")
        return rate
    elif not report.faults:
        report.add_missing("sample rate, or unit of the time column", "rate", " 51200")
    return 0.0


def _check_gravity_offset(responses: Sequence[Signal], report: ImportReport) -> None:
    """Report a resting sensor that shows 9.8 in a column called g: it holds m/s^2."""
    for signal in responses:
        offset = abs(float(np.median(signal.values))) if signal.values.size else 0.0
        if signal.unit.lower() == "g" and abs(offset - STANDARD_GRAVITY) < 0.5:
            found = f"column {signal.name} has the unit g, but its idle value is {offset:.2f}, that of gravity in m/s^2"
            report.add_fault(found, "Give the correct unit of the column with Description.columns")


def apply_full_scale(signals: Sequence[Signal], report: ImportReport) -> list[Signal]:
    """Convert values that are fractions of full scale to their unit."""
    shares, full_scale = [signal for signal in signals if signal.per_full_scale], report.description.full_scale
    if full_scale and not shares:
        report.reject_useless("full_scale", None, "the values are not fractions of full scale (-1 to 1)")
    elif len(full_scale) != len(shares):
        several = f"full scale of {len(shares)} channels in the order of the file", " 500,50"
        fact, example = several if shares[1:] else ("full scale of the channel", " 500")
        report.add_missing(fact, "full_scale", example)
    elif shares:
        report.add_fact("full scale", ", ".join(f"{factor:g}" for factor in full_scale), "option")
    if not shares or len(full_scale) != len(shares):
        return list(signals)
    scale = dict(zip(map(id, shares), full_scale, strict=True))
    return [replace(signal, values=signal.values * scale.get(id(signal), 1.0)) for signal in signals]
