"""Resolve units and sensor sensitivities of responses, forces and FRFs."""

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import cast

from acquisition.files.contents.column_headings import format_signal_names, is_decibel, parse_decibel_reference
from acquisition.files.contents.contents import ImportReport, Origin, Signal, UnresolvedError
from acquisition.files.contents.units import MOTION_QUANTITIES, VOLTAGE_UNITS, Unit, get_motion, parse_unit

_SENSITIVITY_PATTERN = re.compile(r"\s*([+-]?\d+\.?\d*(?:[eE][+-]?\d+)?)\s*([a-zA-Zµ]+)\s*(?:/|per)\s*(.+?)\s*")
_VOLTAGE_RATIO_PATTERN = re.compile(r"\s*\(?([a-zA-Zµ]+)\)?\s*/\s*\(?([a-zA-Zµ]+)\)?\s*")
_SENSITIVITY_EXAMPLE = ' "2.25 mV/N,10.2 mV/g"'


def convert_to_sensor_units(signals: Sequence[Signal], report: ImportReport) -> list[Signal]:
    """Convert signals in volts to the units of their sensors."""
    volts = {id(signal): VOLTAGE_UNITS[signal.unit.lower()] for signal in signals if is_voltage(signal.unit)}
    wired = [signal for signal in signals if id(signal) in volts]
    given = report.description.sensitivity
    if not wired:
        if given:
            report.reject_useless("sensitivity", None, "no channel is in volts")
        return list(signals)
    if len(given) != len(wired):
        fact = f"sensitivity of each channel in volts, in the order {format_signal_names(wired)}"
        raise report.add_missing(fact, "sensitivity", _SENSITIVITY_EXAMPLE)
    sensors = [report.attempt(_parse_sensitivity, text) for text in given]
    report.add_fact("sensitivity", ", ".join(given), "option")
    measured = {
        id(signal): replace(signal, values=signal.values * (volts[id(signal)] / sensor[0]), unit=sensor[1])
        for signal, sensor in zip(wired, sensors, strict=True)
        if sensor is not None
    }
    if None in sensors:
        raise UnresolvedError
    return [measured.get(id(signal), signal) for signal in signals]


def is_voltage(unit: str) -> bool:
    """Return whether a unit is one of a voltage."""
    return unit.lower() in VOLTAGE_UNITS


def _resolve_voltage_frf_unit(unit: str, report: ImportReport) -> tuple[str, float]:
    """Return the unit of an FRF and a factor to it; of `V/N` or `V/V` by the sensitivities of its sensors."""
    ratio, sensitivity = _VOLTAGE_RATIO_PATTERN.fullmatch(unit), report.description.sensitivity
    if ratio is None or not is_voltage(ratio[1]):
        if sensitivity:
            report.reject_useless("sensitivity", None, "the FRF is not in volts")
        return unit, 1.0
    over_volts = is_voltage(ratio[2])
    whose, example = ("hammer and sensor", _SENSITIVITY_EXAMPLE) if over_volts else ("the sensor", ' "10.2 mV/g"')
    given = ", ".join(sensitivity)
    if len(sensitivity) != 1 + over_volts:
        raise report.add_missing(f"sensitivity of {whose}, because the FRF is in {unit}", "sensitivity", example)
    sensors = [sensor for text in sensitivity if (sensor := report.attempt(_parse_sensitivity, text)) is not None]
    sensors.sort(key=lambda sensor: _is_force_unit(sensor[1]))
    if [_is_force_unit(sensor[1]) for sensor in sensors] != [False, True][: 1 + over_volts]:
        found = f"the FRF is in {unit}"
        raise report.reject("sensitivity", given, found, f"Give the sensitivity of {whose}, as in{example}")
    report.add_fact("sensitivity", given, "option")
    (volts, motion), factor = sensors[0], VOLTAGE_UNITS[ratio[1].lower()]
    if not over_volts:
        return f"({motion})/({ratio[2]})", factor / volts
    return f"({motion})/({sensors[1][1]})", factor / volts * sensors[1][0] / VOLTAGE_UNITS[ratio[2].lower()]


def _is_force_unit(text: str) -> bool:
    unit = parse_unit(text)
    return unit is not None and unit.quantity == "force"


def _parse_sensitivity(text: str, report: ImportReport) -> tuple[float, str]:
    """Return the volts per unit, and the unit."""
    match = _SENSITIVITY_PATTERN.fullmatch(text)
    if match is None or parse_unit(match[3]) is None or not is_voltage(match[2]) or not float(match[1]):
        found, cure = "not in volts per unit of the sensor", f"Give sensitivities as in{_SENSITIVITY_EXAMPLE}"
        raise report.reject("sensitivity", repr(text), found, cure)
    return float(match[1]) * VOLTAGE_UNITS[match[2].lower()], match[3]


def choose_signal(signals: Sequence[Signal], noun: str, report: ImportReport) -> Signal:
    """Return the signal of the response that the description chooses, or the only one; noun: for people."""
    response = report.description.response
    if response is not None and not 1 <= response <= len(signals):
        raise report.reject("response", response, f"the file has only {len(signals)} {noun}")
    if response is None and len(signals) > 1:
        names = ", ".join(f"{i} {signal.name}" for i, signal in enumerate(signals[:12], 1))
        more = f" and {len(signals) - 12} more" if len(signals) > 12 else ""
        raise report.add_missing(f"choice of one of {len(signals)} {noun}: {names}{more}", "response", " 1")
    signal = signals[(response or 1) - 1]
    report.add_fact("response", signal.name, "file" if response is None else "option")
    return signal


def resolve_frf_unit(signal: Signal, report: ImportReport) -> tuple[str, float]:
    """Return the quantity of the response of an FRF, and the factor to SI."""
    in_file = parse_decibel_reference(signal.unit) if is_decibel(signal.unit) else signal.unit
    text, scale = _resolve_voltage_frf_unit(in_file or report.description.unit, report)
    stated = (text, report.description.unit) if in_file else ("", text)
    wanted = ("receptance", "mobility", "accelerance", *MOTION_QUANTITIES)
    unit, origin = _resolve_unit(*stated, wanted, ("unit", "m/N, um/N or g/N", signal.name), report)
    force, quantity = report.attempt(_resolve_frf_force, unit), get_motion(unit.quantity)
    _check_quantity(quantity, signal, report)
    if force is None:
        raise UnresolvedError
    report.add_fact("unit", f"{in_file or report.description.unit} ({quantity})", origin)
    return quantity, scale * unit.factor / force


def resolve_response_unit(signal: Signal, report: ImportReport) -> tuple[str, float]:
    """Return the quantity of a response over time, and the factor to SI."""
    given, texts = report.description.unit, ("unit", "m/s^2 or g", signal.name)
    unit, origin = _resolve_unit(signal.unit, given, MOTION_QUANTITIES, texts, report)
    _check_quantity(unit.quantity, signal, report)
    report.add_fact("unit", f"{signal.unit or given} ({unit.quantity})", origin)
    report.units.append(signal.unit or given)
    return unit.quantity, unit.factor


def resolve_force_unit(signal: Signal, report: ImportReport) -> float:
    """Return the factor to N of a force over time."""
    given, texts = report.description.force_unit, ("force_unit", "N or lbf", signal.name)
    unit, origin = _resolve_unit(signal.unit, given, ("force",), texts, report)
    report.add_fact("force", f"{signal.name}, {signal.unit or given}", origin)
    report.units.append(signal.unit or given)
    return unit.factor


def _resolve_unit(
    in_file: str, given: str, wanted: Sequence[str], texts: tuple[str, str, str], report: ImportReport
) -> tuple[Unit, Origin]:
    """Return the unit that the file or the description states; texts: field, examples and name of the signal."""
    field_name, examples, name = texts
    file_unit, given_unit = parse_unit(in_file) if in_file else None, parse_unit(given) if given else None
    if given and (given_unit is None or given_unit.quantity not in wanted):
        raise report.reject(field_name, given, f"not a unit of column {name!r}", f"Give a unit such as {examples}")
    if in_file and (file_unit is None or file_unit.quantity not in wanted):
        cure = f"Give the meaning of the column with Description.columns, and a unit such as {examples}"
        raise report.add_fault(f"unit {in_file!r} of {name} is unknown or of another quantity", cure)
    if file_unit is not None and given_unit is not None and file_unit != given_unit:
        raise report.add_contradiction(field_name, given, in_file)
    if file_unit is None and given_unit is None:
        raise report.add_missing(f"unit of {name}", field_name, f" {examples}")
    return (file_unit, "file") if file_unit is not None else (cast(Unit, given_unit), "option")


def _resolve_frf_force(unit: Unit, report: ImportReport) -> float:
    """Return the factor to N of the force in an FRF whose unit is only that of the response."""
    given = report.description.force_unit
    if unit.quantity not in MOTION_QUANTITIES:
        if given:
            report.reject_useless("force_unit", given, "the unit of the FRF already includes the unit of the force")
        return 1.0
    force = parse_unit(given)
    if force is None or force.quantity != "force":
        raise report.add_missing("unit of the force in the FRF", "force_unit", " N, or Description.unit g/N")
    return force.factor


def _check_quantity(by_unit: str, signal: Signal, report: ImportReport) -> None:
    """Check that file and description do not contradict the quantity of the response by its unit."""
    given, unit = report.description.quantity, signal.unit or report.description.unit
    if given and given not in MOTION_QUANTITIES:
        raise report.reject("quantity", given, f"not one of {', '.join(MOTION_QUANTITIES)}")
    if given and given != by_unit:
        raise report.reject("quantity", given, f"{unit} is a unit of {by_unit}")
    if signal.quantity and signal.quantity != by_unit:
        raise report.add_fault(f"{signal.name} is {signal.quantity} in the file, but {unit} is a unit of {by_unit}")
