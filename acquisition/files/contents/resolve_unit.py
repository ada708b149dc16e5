"""Resolve units and sensor sensitivities of responses, forces and FRFs."""

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import cast

from acquisition.files.contents.column_headings import format_signal_names, is_decibel, parse_decibel_reference
from acquisition.files.contents.contents import Signal
from acquisition.files.contents.description import Description, ImportReport, Origin
from acquisition.files.contents.units import VOLTAGE_UNITS, Unit, get_motion, parse_unit

MOTION_QUANTITIES = ("displacement", "velocity", "acceleration")
"""Quantities of a response."""
_SENSITIVITY_PATTERN = re.compile(r"\s*([+-]?\d+\.?\d*(?:[eE][+-]?\d+)?)\s*([a-zA-Zµ]+)\s*(?:/|per)\s*(.+?)\s*")
_VOLTAGE_RATIO_PATTERN = re.compile(r"\s*\(?([a-zA-Zµ]+)\)?\s*/\s*\(?([a-zA-Zµ]+)\)?\s*")
_SENSITIVITY_EXAMPLE = ' "2.25 mV/N,10.2 mV/g"'


def convert_to_sensor_units(
    signals: Sequence[Signal], description: Description, report: ImportReport
) -> list[Signal] | None:
    """Convert signals in volts to the units of their sensors; None where a sensitivity is missing or wrong."""
    volts = {id(signal): VOLTAGE_UNITS[signal.unit.lower()] for signal in signals if is_voltage(signal.unit)}
    wired = [signal for signal in signals if id(signal) in volts]
    if not wired and description.sensitivity:
        report.reject("sensitivity", None, "it has no channel in volts; leave it out")
    if not wired:
        return list(signals)
    if len(description.sensitivity) != len(wired):
        fact = f"the sensitivity of each of {format_signal_names(wired)}, in their order"
        report.add_missing(fact, "sensitivity", _SENSITIVITY_EXAMPLE)
        return None
    sensors = [_parse_sensitivity(text, report) for text in description.sensitivity]
    report.add_fact("sensitivity", ", ".join(description.sensitivity), "option")
    measured = {
        id(signal): replace(signal, values=signal.values * (volts[id(signal)] / sensor[0]), unit=sensor[1])
        for signal, sensor in zip(wired, sensors, strict=True)
        if sensor is not None
    }
    return None if len(measured) < len(wired) else [measured.get(id(signal), signal) for signal in signals]


def is_voltage(unit: str) -> bool:
    """Return whether a unit is one of a voltage."""
    return unit.lower() in VOLTAGE_UNITS


def resolve_voltage_frf_unit(unit: str, description: Description, report: ImportReport) -> tuple[str, float] | None:
    """Return the unit of an FRF and a factor to it; of `V/N` or `V/V` by the sensitivities of its sensors.

    None where a sensitivity is missing or wrong.
    """
    ratio = _VOLTAGE_RATIO_PATTERN.fullmatch(unit)
    if ratio is None or not is_voltage(ratio[1]):
        if description.sensitivity:
            report.reject("sensitivity", None, "its FRF is not in volts; leave it out")
        return unit, 1.0
    over_volts = is_voltage(ratio[2])
    whose, example = ("hammer and sensor", _SENSITIVITY_EXAMPLE) if over_volts else ("the sensor", ' "10.2 mV/g"')
    given = ", ".join(description.sensitivity)
    if len(description.sensitivity) != 1 + over_volts:
        report.add_missing(f"the sensitivity of {whose}, as its FRF is in {unit}", "sensitivity", example)
        return None
    sensors = [sensor for text in description.sensitivity if (sensor := _parse_sensitivity(text, report)) is not None]
    sensors.sort(key=lambda sensor: _is_force_unit(sensor[1]))
    if [_is_force_unit(sensor[1]) for sensor in sensors] != [False, True][: 1 + over_volts]:
        report.reject("sensitivity", given, f"give that of {whose}: Description.sensitivity{example}")
        return None
    report.add_fact("sensitivity", given, "option")
    (volts, motion), factor = sensors[0], VOLTAGE_UNITS[ratio[1].lower()]
    if not over_volts:
        return f"({motion})/({ratio[2]})", factor / volts
    return f"({motion})/({sensors[1][1]})", factor / volts * sensors[1][0] / VOLTAGE_UNITS[ratio[2].lower()]


def _is_force_unit(text: str) -> bool:
    unit = parse_unit(text)
    return unit is not None and unit.quantity == "force"


def _parse_sensitivity(text: str, report: ImportReport) -> tuple[float, str] | None:
    """Return the volts per unit, and the unit."""
    match = _SENSITIVITY_PATTERN.fullmatch(text)
    if match is None or parse_unit(match[3]) is None or not is_voltage(match[2]) or not float(match[1]):
        example = f"Description.sensitivity{_SENSITIVITY_EXAMPLE}"
        report.reject("sensitivity", repr(text), f"give volts a unit of each channel, as in {example}")
        return None
    return float(match[1]) * VOLTAGE_UNITS[match[2].lower()], match[3]


def choose_signal(signals: Sequence[Signal], response: int | None, noun: str, report: ImportReport) -> Signal | None:
    """Return the signal of this number, or the only one; None where the report says why none is chosen.

    noun: word for the signals, for people.
    """
    if response is not None and not 1 <= response <= len(signals):
        report.reject("response", response, f"it holds {len(signals)} of the {noun} asked for")
        return None
    if response is None and len(signals) > 1:
        names = ", ".join(f"{i} {signal.name}" for i, signal in enumerate(signals[:12], 1))
        more = f" and {len(signals) - 12} more" if len(signals) > 12 else ""
        report.add_missing(f"which of its {len(signals)} {noun} is meant: {names}{more}", "response", " 1")
        return None
    signal = signals[(response or 1) - 1]
    report.add_fact("response", signal.name, "file" if response is None else "option")
    return signal


def resolve_frf_unit(signal: Signal, description: Description, report: ImportReport) -> tuple[str, float] | None:
    """Return the quantity of the response of an FRF, and the factor to SI."""
    in_file = parse_decibel_reference(signal.unit) if is_decibel(signal.unit) else signal.unit
    voltage = resolve_voltage_frf_unit(in_file or description.unit, description, report)
    if voltage is None:
        return None
    (text, scale), wanted = voltage, ("receptance", "mobility", "accelerance", *MOTION_QUANTITIES)
    in_file_unit, given = (text, description.unit) if in_file else ("", text)
    agreed = _resolve_unit(in_file_unit, given, wanted, ("unit", "m/N, um/N, g/N", signal.name), report)
    if agreed is None:
        return None
    (unit, origin), force = agreed, _resolve_frf_force(description, agreed[0], report)
    quantity = _resolve_quantity(get_motion(unit.quantity), signal, description, report)
    if force is None or not quantity:
        return None
    report.add_fact("unit", f"{in_file or description.unit} ({quantity})", origin)
    return quantity, scale * unit.factor / force


def resolve_response_unit(signal: Signal, description: Description, report: ImportReport) -> tuple[str, float] | None:
    """Return the quantity of a response over time, and the factor to SI."""
    texts = ("unit", "m/s^2, g", signal.name)
    agreed = _resolve_unit(signal.unit, description.unit, MOTION_QUANTITIES, texts, report)
    if agreed is None:
        return None
    unit, origin = agreed
    quantity = _resolve_quantity(unit.quantity, signal, description, report)
    if not quantity:
        return None
    report.add_fact("unit", f"{signal.unit or description.unit} ({quantity})", origin)
    return quantity, unit.factor


def resolve_force_unit(signal: Signal, description: Description, report: ImportReport) -> float | None:
    """Return the factor to N of a force over time."""
    texts = ("force_unit", "N, lbf", signal.name)
    agreed = _resolve_unit(signal.unit, description.force_unit, ("force",), texts, report)
    if agreed is None:
        return None
    report.add_fact("force", f"{signal.name}, {signal.unit or description.force_unit}", agreed[1])
    return agreed[0].factor


def _resolve_unit(
    in_file: str, given: str, wanted: Sequence[str], texts: tuple[str, str, str], report: ImportReport
) -> tuple[Unit, Origin] | None:
    """Return the unit that the file or the description states; texts: field, examples and name of the signal."""
    field_name, examples, name = texts
    file_unit, given_unit = parse_unit(in_file) if in_file else None, parse_unit(given) if given else None
    if given and (given_unit is None or given_unit.quantity not in wanted):
        report.reject(field_name, given, f"not known as a unit of {name}; give one like {examples}")
    elif in_file and (file_unit is None or file_unit.quantity not in wanted):
        fault = f"{name} is in {in_file!r}, which is not known here as its unit (known are such as {examples})"
        report.faults.append(f"{fault}; where that is wrong say with Description.columns what it is")
    elif file_unit is not None and given_unit is not None and file_unit != given_unit:
        report.add_contradiction(field_name, given, in_file)
    elif file_unit is None and given_unit is None:
        report.add_missing(f"the unit of {name}", field_name, f", such as {examples}")
    else:
        return (file_unit, "file") if file_unit is not None else (cast(Unit, given_unit), "option")
    return None


def _resolve_frf_force(description: Description, unit: Unit, report: ImportReport) -> float | None:
    """Return the factor to N of the force in an FRF whose unit is only that of the response."""
    if unit.quantity not in MOTION_QUANTITIES:
        if description.force_unit:
            report.reject("force_unit", description.force_unit, "the unit of the FRF holds that of the force")
        return 1.0
    force = parse_unit(description.force_unit)
    if force is None or force.quantity != "force":
        fact = "the unit of the force that the response was divided by"
        report.add_missing(fact, "force_unit", " N, or both as Description.unit g/N")
        return None
    return force.factor


def _resolve_quantity(by_unit: str, signal: Signal, description: Description, report: ImportReport) -> str:
    """Return the quantity of the response; empty where file and description contradict each other."""
    given, unit = description.quantity, signal.unit or description.unit
    if given and given not in MOTION_QUANTITIES:
        report.reject("quantity", given, f"none of {', '.join(MOTION_QUANTITIES)}")
    elif given and given != by_unit:
        report.reject("quantity", given, f"its unit, {unit}, is one of {by_unit}")
    elif signal.quantity and signal.quantity != by_unit:
        report.faults.append(f"it calls {signal.name} {signal.quantity}, and {unit} is a unit of {by_unit}")
    else:
        return by_unit
    return ""
