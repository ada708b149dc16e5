"""Which response is meant, and the units of it: from the file, by option, or asked for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

from acquisition.files.contents.contents import Signal
from acquisition.files.contents.description import Description
from acquisition.files.contents.heading import is_level, unit_of_level
from acquisition.files.contents.ledger import Ledger, Origin
from acquisition.files.contents.sensitivity import sensed_frf
from acquisition.files.contents.units import Unit, motion_of, unit_of

MOTIONS = ("displacement", "velocity", "acceleration")
"""What a response can be."""


def chosen(signals: Sequence[Signal], response: int | None, noun: str, ledger: Ledger) -> Signal | None:
    """The one that is meant; noun: word for what there are several of, for people."""
    if response is not None and not 1 <= response <= len(signals):
        ledger.faults.append(f"--response {response}: it holds {len(signals)} of the {noun} asked for")
        return None
    if response is None and len(signals) > 1:
        names = ", ".join(f"{i} {signal.name}" for i, signal in enumerate(signals[:12], 1))
        more = f" and {len(signals) - 12} more" if len(signals) > 12 else ""
        ledger.ask(f"which of its {len(signals)} {noun} is meant: {names}{more}", "--response 1")
        return None
    signal = signals[(response or 1) - 1]
    ledger.know("response", signal.name, "file" if response is None else "option")
    return signal


def frf_unit(signal: Signal, description: Description, ledger: Ledger) -> tuple[str, float] | None:
    """Quantity of the response, and the factor to SI, of an FRF."""
    in_file = unit_of_level(signal.unit) if is_level(signal.unit) else signal.unit
    sensed = sensed_frf(in_file or description.unit, description, ledger)
    if sensed is None:
        return None
    (text, scale), wanted = sensed, ("receptance", "mobility", "accelerance", *MOTIONS)
    unit_in_file, given = (text, description.unit) if in_file else ("", text)
    agreed = _either(unit_in_file, given, wanted, ("--unit", "m/N, um/N, g/N", signal.name), ledger)
    if agreed is None:
        return None
    (unit, origin), force = agreed, _force_of_frf(description, agreed[0], ledger)
    quantity = _quantity(motion_of(unit.quantity), signal, description, ledger)
    if force is None or not quantity:
        return None
    ledger.know("unit", f"{in_file or description.unit} ({quantity})", origin)
    return quantity, scale * unit.factor / force


def response_unit(signal: Signal, description: Description, ledger: Ledger) -> tuple[str, float] | None:
    """Quantity and factor to SI of a response over time."""
    agreed = _either(signal.unit, description.unit, MOTIONS, ("--unit", "m/s^2, g", signal.name), ledger)
    if agreed is None:
        return None
    unit, origin = agreed
    quantity = _quantity(unit.quantity, signal, description, ledger)
    if not quantity:
        return None
    ledger.know("unit", f"{signal.unit or description.unit} ({quantity})", origin)
    return quantity, unit.factor


def force_unit(signal: Signal, description: Description, ledger: Ledger) -> float | None:
    """Factor to N of a force over time."""
    agreed = _either(signal.unit, description.force_unit, ("force",), ("--force-unit", "N, lbf", signal.name), ledger)
    if agreed is None:
        return None
    ledger.know("force", f"{signal.name}, {signal.unit or description.force_unit}", agreed[1])
    return agreed[0].factor


def _either(
    in_file: str, given: str, wanted: Sequence[str], texts: tuple[str, str, str], ledger: Ledger
) -> tuple[Unit, Origin] | None:
    """The unit that the file or the option names; texts: the option, examples, and whose unit it is."""
    option, examples, name = texts
    file_unit, given_unit = unit_of(in_file) if in_file else None, unit_of(given) if given else None
    if given and (given_unit is None or given_unit.quantity not in wanted):
        ledger.faults.append(f"{option} {given}: not known as a unit of {name}; give one like {examples}")
        return None
    if in_file and (file_unit is None or file_unit.quantity not in wanted):
        ledger.faults.append(
            f"{name} is in {in_file!r}, which is not known here as its unit (known are such as {examples}); "
            "where that is wrong say with --columns what it is"
        )
        return None
    if file_unit is not None and given_unit is not None and file_unit != given_unit:
        ledger.contradict(option, given, in_file)
        return None
    if file_unit is None and given_unit is None:
        ledger.ask(f"the unit of {name}", f"{option}, such as {examples}")
        return None
    return (file_unit, "file") if file_unit is not None else (cast(Unit, given_unit), "option")


def _force_of_frf(description: Description, unit: Unit, ledger: Ledger) -> float | None:
    """Factor to N of what the response was divided by, where its unit does not hold that."""
    if unit.quantity not in MOTIONS:
        if description.force_unit:
            ledger.faults.append(f"--force-unit {description.force_unit}: the unit of the FRF holds that of the force")
        return 1.0
    force = unit_of(description.force_unit)
    if force is None or force.quantity != "force":
        ledger.ask("the unit of the force that the response was divided by", "--force-unit N, or both as --unit g/N")
        return None
    return force.factor


def _quantity(by_unit: str, signal: Signal, description: Description, ledger: Ledger) -> str:
    """Of the response; empty where what is said of it does not agree."""
    if description.quantity and description.quantity not in MOTIONS:
        ledger.faults.append(f"--quantity {description.quantity}: none of {', '.join(MOTIONS)}")
        return ""
    if description.quantity and description.quantity != by_unit:
        ledger.faults.append(
            f"--quantity {description.quantity}: its unit, {signal.unit or description.unit}, is one of {by_unit}"
        )
        return ""
    if signal.quantity and signal.quantity != by_unit:
        unit = signal.unit or description.unit
        ledger.faults.append(f"it calls {signal.name} {signal.quantity}, and {unit} is a unit of {by_unit}")
        return ""
    return by_unit
