"""Channels in volts, turned into what their sensors measure: the sensitivities are said by option."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from acquisition.files.contents.contents import Signal
from acquisition.files.contents.description import Description
from acquisition.files.contents.ledger import Ledger
from acquisition.files.contents.named_columns import names_of
from acquisition.files.contents.units import VOLTS, unit_of

_SENSITIVITY = re.compile(r"\s*([+-]?\d+\.?\d*(?:[eE][+-]?\d+)?)\s*([a-zA-Zµ]+)\s*(?:/|per)\s*(.+?)\s*")
_OF_VOLTS = re.compile(r"\s*\(?([a-zA-Zµ]+)\)?\s*/\s*\(?([a-zA-Zµ]+)\)?\s*")
_EXAMPLE = '--sensitivity "2.25 mV/N,10.2 mV/g"'


def in_sensor_units(signals: Sequence[Signal], description: Description, ledger: Ledger) -> list[Signal] | None:
    """Signals over time, those in volts in the units of their sensors; None where one of these is missing or wrong."""
    volts = {id(signal): VOLTS[signal.unit.lower()] for signal in signals if signal.unit.lower() in VOLTS}
    wired = [signal for signal in signals if id(signal) in volts]
    if not wired and description.sensitivity:
        ledger.faults.append("--sensitivity: it has no channel in volts; leave it out")
    if not wired:
        return list(signals)
    if len(description.sensitivity) != len(wired):
        ledger.ask(f"the sensitivity of each of {names_of(wired)}, in their order", _EXAMPLE)
        return None
    sensors = [_parsed(text, ledger) for text in description.sensitivity]
    ledger.know("sensitivity", ", ".join(description.sensitivity), "option")
    sensor_of = {id(signal): sensor for signal, sensor in zip(wired, sensors, strict=True) if sensor is not None}
    if len(sensor_of) < len(wired):
        return None
    measured = {id(channel): _measured(channel, volts[id(channel)], sensor_of[id(channel)]) for channel in wired}
    return [measured.get(id(signal), signal) for signal in signals]


def sensed_frf(unit: str, description: Description, ledger: Ledger) -> tuple[str, float] | None:
    """The unit of an FRF and a factor to it; of one in volts, `V/N` or `V/V`, by the sensitivities of its sensors.

    None where one of these is missing or wrong.
    """
    ratio = _OF_VOLTS.fullmatch(unit)
    if ratio is None or ratio[1].lower() not in VOLTS:
        if description.sensitivity:
            ledger.faults.append("--sensitivity: its FRF is not in volts; leave it out")
        return unit, 1.0
    over_volts = ratio[2].lower() in VOLTS
    whose, example = ("hammer and sensor", _EXAMPLE) if over_volts else ("the sensor", '--sensitivity "10.2 mV/g"')
    if len(description.sensitivity) != 1 + over_volts:
        ledger.ask(f"the sensitivity of {whose}, as its FRF is in {unit}", example)
        return None
    sensors = [sensor for text in description.sensitivity if (sensor := _parsed(text, ledger)) is not None]
    sensors.sort(key=lambda sensor: _is_force(sensor[1]))
    if [_is_force(sensor[1]) for sensor in sensors] != [False, True][: 1 + over_volts]:
        ledger.faults.append(f"--sensitivity {', '.join(description.sensitivity)}: give that of {whose}: {example}")
        return None
    ledger.know("sensitivity", ", ".join(description.sensitivity), "option")
    (volts, motion), factor = sensors[0], VOLTS[ratio[1].lower()]
    if not over_volts:
        return f"({motion})/({ratio[2]})", factor / volts
    return f"({motion})/({sensors[1][1]})", factor / volts * sensors[1][0] / VOLTS[ratio[2].lower()]


def _is_force(unit: str) -> bool:
    known = unit_of(unit)
    return known is not None and known.quantity == "force"


def _measured(signal: Signal, volts: float, sensor: tuple[float, str]) -> Signal:
    """volts: of one of its unit; sensor: volts a unit, and that unit."""
    return replace(signal, values=signal.values * (volts / sensor[0]), unit=sensor[1])


def _parsed(text: str, ledger: Ledger) -> tuple[float, str] | None:
    """Volts a unit, and the unit."""
    match = _SENSITIVITY.fullmatch(text)
    unit = unit_of(match[3]) if match else None
    if match is None or unit is None or match[2].lower() not in VOLTS or not float(match[1]):
        ledger.faults.append(f"--sensitivity {text!r}: give volts a unit of each channel, as in {_EXAMPLE}")
        return None
    return float(match[1]) * VOLTS[match[2].lower()], match[3]
