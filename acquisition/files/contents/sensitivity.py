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
