"""Resolve units and sensor sensitivities of responses, forces and FRFs."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import cast

from acquisition.files.contents.column_headings import format_signal_names, is_decibel, parse_decibel_reference
from acquisition.files.contents.contents import Signal
from acquisition.files.contents.description import Description, ImportReport, Origin
from acquisition.files.contents.units import VOLTAGE_UNITS, Unit, get_motion, parse_unit

_SENSITIVITY_PATTERN = re.compile(r"\s*([+-]?\d+\.?\d*(?:[eE][+-]?\d+)?)\s*([a-zA-Zµ]+)\s*(?:/|per)\s*(.+?)\s*")
_VOLTAGE_RATIO_PATTERN = re.compile(r"\s*\(?([a-zA-Zµ]+)\)?\s*/\s*\(?([a-zA-Zµ]+)\)?\s*")
_SENSITIVITY_EXAMPLE = '--sensitivity "2.25 mV/N,10.2 mV/g"'


def convert_to_sensor_units(
    signals: Sequence[Signal], description: Description, report: ImportReport
) -> list[Signal] | None:
    """Signals over time, those in volts in the units of their sensors; None where one of these is missing or wrong."""
    volts = {
        id(signal): VOLTAGE_UNITS[signal.unit.lower()] for signal in signals if signal.unit.lower() in VOLTAGE_UNITS
    }
    wired = [signal for signal in signals if id(signal) in volts]
    if not wired and description.sensitivity:
        report.faults.append("--sensitivity: it has no channel in volts; leave it out")
    if not wired:
        return list(signals)
    if len(description.sensitivity) != len(wired):
        report.add_missing(
            f"the sensitivity of each of {format_signal_names(wired)}, in their order", _SENSITIVITY_EXAMPLE
        )
        return None
    sensors = [_parse_sensitivity(text, report) for text in description.sensitivity]
    report.add_fact("sensitivity", ", ".join(description.sensitivity), "option")
    sensor_of = {id(signal): sensor for signal, sensor in zip(wired, sensors, strict=True) if sensor is not None}
    if len(sensor_of) < len(wired):
        return None
    measured = {id(channel): _convert_voltage(channel, volts[id(channel)], sensor_of[id(channel)]) for channel in wired}
    return [measured.get(id(signal), signal) for signal in signals]


def resolve_voltage_frf_unit(unit: str, description: Description, report: ImportReport) -> tuple[str, float] | None:
    """The unit of an FRF and a factor to it; of one in volts, `V/N` or `V/V`, by the sensitivities of its sensors.

    None where one of these is missing or wrong.
    """
    ratio = _VOLTAGE_RATIO_PATTERN.fullmatch(unit)
    if ratio is None or ratio[1].lower() not in VOLTAGE_UNITS:
        if description.sensitivity:
            report.faults.append("--sensitivity: its FRF is not in volts; leave it out")
        return unit, 1.0
    over_volts = ratio[2].lower() in VOLTAGE_UNITS
    whose, example = (
        ("hammer and sensor", _SENSITIVITY_EXAMPLE) if over_volts else ("the sensor", '--sensitivity "10.2 mV/g"')
    )
    if len(description.sensitivity) != 1 + over_volts:
        report.add_missing(f"the sensitivity of {whose}, as its FRF is in {unit}", example)
        return None
    sensors = [sensor for text in description.sensitivity if (sensor := _parse_sensitivity(text, report)) is not None]
    sensors.sort(key=lambda sensor: _is_force_unit(sensor[1]))
    if [_is_force_unit(sensor[1]) for sensor in sensors] != [False, True][: 1 + over_volts]:
        report.faults.append(f"--sensitivity {', '.join(description.sensitivity)}: give that of {whose}: {example}")
        return None
    report.add_fact("sensitivity", ", ".join(description.sensitivity), "option")
    (volts, motion), factor = sensors[0], VOLTAGE_UNITS[ratio[1].lower()]
    if not over_volts:
        return f"({motion})/({ratio[2]})", factor / volts
    return f"({motion})/({sensors[1][1]})", factor / volts * sensors[1][0] / VOLTAGE_UNITS[ratio[2].lower()]


def _is_force_unit(unit: str) -> bool:
    known = parse_unit(unit)
    return known is not None and known.quantity == "force"


def _convert_voltage(signal: Signal, volts: float, sensor: tuple[float, str]) -> Signal:
    """volts: of one of its unit; sensor: volts a unit, and that unit."""
    return replace(signal, values=signal.values * (volts / sensor[0]), unit=sensor[1])


def _parse_sensitivity(text: str, report: ImportReport) -> tuple[float, str] | None:
    """Volts a unit, and the unit."""
    match = _SENSITIVITY_PATTERN.fullmatch(text)
    unit = parse_unit(match[3]) if match else None
    if match is None or unit is None or match[2].lower() not in VOLTAGE_UNITS or not float(match[1]):
        report.faults.append(f"--sensitivity {text!r}: give volts a unit of each channel, as in {_SENSITIVITY_EXAMPLE}")
        return None
    return float(match[1]) * VOLTAGE_UNITS[match[2].lower()], match[3]


MOTION_QUANTITIES = ("displacement", "velocity", "acceleration")
"""What a response can be."""


def choose_signal(signals: Sequence[Signal], response: int | None, noun: str, report: ImportReport) -> Signal | None:
    """The one that is meant; noun: word for what there are several of, for people."""
    if response is not None and not 1 <= response <= len(signals):
        report.faults.append(f"--response {response}: it holds {len(signals)} of the {noun} asked for")
        return None
    if response is None and len(signals) > 1:
        names = ", ".join(f"{i} {signal.name}" for i, signal in enumerate(signals[:12], 1))
        more = f" and {len(signals) - 12} more" if len(signals) > 12 else ""
        report.add_missing(f"which of its {len(signals)} {noun} is meant: {names}{more}", "--response 1")
        return None
    signal = signals[(response or 1) - 1]
    report.add_fact("response", signal.name, "file" if response is None else "option")
    return signal


def resolve_frf_unit(signal: Signal, description: Description, report: ImportReport) -> tuple[str, float] | None:
    """Quantity of the response, and the factor to SI, of an FRF."""
    in_file = parse_decibel_reference(signal.unit) if is_decibel(signal.unit) else signal.unit
    sensed = resolve_voltage_frf_unit(in_file or description.unit, description, report)
    if sensed is None:
        return None
    (text, scale), wanted = sensed, ("receptance", "mobility", "accelerance", *MOTION_QUANTITIES)
    unit_in_file, given = (text, description.unit) if in_file else ("", text)
    agreed = _resolve_unit(unit_in_file, given, wanted, ("--unit", "m/N, um/N, g/N", signal.name), report)
    if agreed is None:
        return None
    (unit, origin), force = agreed, _resolve_frf_force(description, agreed[0], report)
    quantity = _resolve_quantity(get_motion(unit.quantity), signal, description, report)
    if force is None or not quantity:
        return None
    report.add_fact("unit", f"{in_file or description.unit} ({quantity})", origin)
    return quantity, scale * unit.factor / force


def resolve_response_unit(signal: Signal, description: Description, report: ImportReport) -> tuple[str, float] | None:
    """Quantity and factor to SI of a response over time."""
    agreed = _resolve_unit(
        signal.unit, description.unit, MOTION_QUANTITIES, ("--unit", "m/s^2, g", signal.name), report
    )
    if agreed is None:
        return None
    unit, origin = agreed
    quantity = _resolve_quantity(unit.quantity, signal, description, report)
    if not quantity:
        return None
    report.add_fact("unit", f"{signal.unit or description.unit} ({quantity})", origin)
    return quantity, unit.factor


def resolve_force_unit(signal: Signal, description: Description, report: ImportReport) -> float | None:
    """Factor to N of a force over time."""
    agreed = _resolve_unit(
        signal.unit, description.force_unit, ("force",), ("--force-unit", "N, lbf", signal.name), report
    )
    if agreed is None:
        return None
    report.add_fact("force", f"{signal.name}, {signal.unit or description.force_unit}", agreed[1])
    return agreed[0].factor


def _resolve_unit(
    in_file: str, given: str, wanted: Sequence[str], texts: tuple[str, str, str], report: ImportReport
) -> tuple[Unit, Origin] | None:
    """The unit that the file or the option names; texts: the option, examples, and whose unit it is."""
    option, examples, name = texts
    file_unit, given_unit = parse_unit(in_file) if in_file else None, parse_unit(given) if given else None
    if given and (given_unit is None or given_unit.quantity not in wanted):
        report.faults.append(f"{option} {given}: not known as a unit of {name}; give one like {examples}")
        return None
    if in_file and (file_unit is None or file_unit.quantity not in wanted):
        report.faults.append(
            f"{name} is in {in_file!r}, which is not known here as its unit (known are such as {examples}); "
            "where that is wrong say with --columns what it is"
        )
        return None
    if file_unit is not None and given_unit is not None and file_unit != given_unit:
        report.add_contradiction(option, given, in_file)
        return None
    if file_unit is None and given_unit is None:
        report.add_missing(f"the unit of {name}", f"{option}, such as {examples}")
        return None
    return (file_unit, "file") if file_unit is not None else (cast(Unit, given_unit), "option")


def _resolve_frf_force(description: Description, unit: Unit, report: ImportReport) -> float | None:
    """Factor to N of what the response was divided by, where its unit does not hold that."""
    if unit.quantity not in MOTION_QUANTITIES:
        if description.force_unit:
            report.faults.append(f"--force-unit {description.force_unit}: the unit of the FRF holds that of the force")
        return 1.0
    force = parse_unit(description.force_unit)
    if force is None or force.quantity != "force":
        report.add_missing(
            "the unit of the force that the response was divided by", "--force-unit N, or both as --unit g/N"
        )
        return None
    return force.factor


def _resolve_quantity(by_unit: str, signal: Signal, description: Description, report: ImportReport) -> str:
    """Of the response; empty where what is said of it does not agree."""
    if description.quantity and description.quantity not in MOTION_QUANTITIES:
        report.faults.append(f"--quantity {description.quantity}: none of {', '.join(MOTION_QUANTITIES)}")
        return ""
    if description.quantity and description.quantity != by_unit:
        report.faults.append(
            f"--quantity {description.quantity}: its unit, {signal.unit or description.unit}, is one of {by_unit}"
        )
        return ""
    if signal.quantity and signal.quantity != by_unit:
        unit = signal.unit or description.unit
        report.faults.append(f"it calls {signal.name} {signal.quantity}, and {unit} is a unit of {by_unit}")
        return ""
    return by_unit
