"""The hits in what a file holds and what a person adds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from acquisition.files.contents.axis import EVEN, printed_step, step_of
from acquisition.files.contents.contents import Contents, Signal
from acquisition.files.contents.description import Description
from acquisition.files.contents.ledger import Fact, Ledger
from acquisition.files.contents.motion import hit_of_motion
from acquisition.files.contents.named_columns import names_of
from acquisition.files.contents.sensitivity import in_sensor_units
from acquisition.files.contents.settle_unit import MOTIONS, chosen, force_unit, response_unit
from acquisition.files.contents.units import STANDARD_GRAVITY, unit_of
from acquisition.files.contents.whole_columns import cut_to_shortest, refuse_flaws
from acquisition.hit import Hit
from acquisition.hits.hits_in_record import hits_in_record

COLUMNS_HIT = '--columns "time [s],force [N],acceleration [g]", in their order, or each with =NAME'
"""How hits are named."""
NO_SENSOR = "hammer none where no force was measured"
"""What is said where there is no force."""
FEW_DIGITS = Fact("note", "its time is printed with few digits: whether samples are missing cannot be seen", "file")
SAME_RATE = 1e-4
"""Relative difference of two sample rates that are taken for one: that of a rate with five digits."""


def settle_hits(contents: Contents, description: Description, ledger: Ledger) -> list[Hit]:
    """Those of each record; empty where something is missing or wrong, which the ledger then says."""
    hits = list[Hit]()
    for record in dict.fromkeys(signal.record for signal in contents.signals):
        of_one = Ledger()
        hit = _hit([signal for signal in contents.signals if signal.record == record], description, of_one)
        if not of_one.is_clean or hit is None:
            ledger.add(replace(of_one, facts=[]))
            return []
        ledger.facts += of_one.facts if not hits else []
        parts = hits_in_record(hit)
        if len(parts) > 1:
            ledger.know("hits", f"{len(parts)} in one record, each of {parts[0].acceleration.size} samples")
        hits += parts
    return hits


def _hit(signals: Sequence[Signal], description: Description, ledger: Ledger) -> Hit | None:
    scaled = in_sensor_units(in_their_unit(signals, description, ledger), description, ledger)
    if scaled is None:
        if sum(signal.role != "time" for signal in signals) > 2 and description.response is None:
            ledger.ask("which of its responses is meant", "--response 1")
        rate_of(signals, (), description, ledger)
        return None
    signals = scaled
    forces, responses = _by_kind(signals, description, ledger)
    choice = Ledger()
    response = chosen(responses, description.response, "responses", choice) if responses else None
    rate, used = rate_of(signals, [*forces, *([response] if response else [])], description, ledger)
    ledger.add(choice)
    forces, response = (used[:-1], used[-1]) if response else (forces, None)
    force = _force(forces, description, ledger)
    unit = response_unit(response or responses[0], description, ledger) if responses else None
    _doubt_gravity([response] if response else responses, ledger)
    if force is None or response is None or unit is None or not ledger.is_clean:
        return None
    try:
        hit = hit_of_motion(force, response.values * unit[1], rate, unit[0])
    except ValueError as error:
        ledger.faults.append(str(error))
        return None
    if unit[0] != "acceleration":
        ledger.know("note", f"its {unit[0]} is differentiated")
    return hit


def _force(forces: Sequence[Signal], description: Description, ledger: Ledger) -> NDArray[np.float64] | None:
    """Force (N), empty where none was measured; None where it is missing, or its unit."""
    if description.without_force:
        return np.empty(0)
    if len(forces) != 1:
        return None
    to_newton = force_unit(forces[0], description, ledger)
    return None if to_newton is None else np.asarray(forces[0].values * to_newton)


def _by_kind(signals: Sequence[Signal], description: Description, ledger: Ledger) -> tuple[list[Signal], list[Signal]]:
    """Forces and responses; what neither unit nor name tells is asked about."""
    needs_force = not description.without_force
    forces = [signal for signal in signals if needs_force and kind_of(signal) == "force"]
    responses = [signal for signal in signals if kind_of(signal) == "response"]
    unclear = [channel for channel in signals if not kind_of(channel) and channel.role in ("", "real", "magnitude")]
    channels = [channel for channel in signals if channel.role != "time"]
    names = names_of(channels)
    if len(channels) < 1 + needs_force:
        ledger.faults.append(
            f"it holds {names or 'nothing'} over time; a hit needs "
            + (f"a force and a response (--force FILE; {NO_SENSOR})" if needs_force else "a response")
        )
        return [], []
    if unclear and ((needs_force and not forces) or not responses):
        ledger.ask(f"what its columns are ({names_of(signals)})", COLUMNS_HIT)
        return forces, responses
    if needs_force and not forces:
        ledger.faults.append(f"no force channel among {names}; one is needed ({NO_SENSOR})")
    if needs_force and len(forces) > 1:
        ledger.ask(f"which force of {names_of(forces)} goes with which response", COLUMNS_HIT)
    if not responses:
        ledger.faults.append(f"no channel of a response among {names}")
    return forces, responses


def kind_of(signal: Signal) -> str:
    """force or response by the role or the unit; empty where neither tells."""
    unit = unit_of(signal.unit) if signal.unit else None
    quantity = signal.quantity or (unit.quantity if unit else "")
    by_quantity = "response" if quantity in MOTIONS else quantity if quantity == "force" else ""
    return by_quantity or (signal.role if signal.role in ("force", "response") else "")


def rate_of(
    signals: Sequence[Signal], used: Sequence[Signal], description: Description, ledger: Ledger
) -> tuple[float, list[Signal]]:
    """Samples a second (Hz), 0 where that is missing or wrong; and the signals that are used, in one length."""
    times = [signal for signal in signals if signal.role == "time"]
    used, times = cut_to_shortest(used, times, ledger)
    of_one_length = used or [signal for signal in signals if signal.values.size == signals[0].values.size]
    if len({signal.values.size for signal in of_one_length}) > 1:
        ledger.faults.append(f"its channels differ in length: {names_of(of_one_length)}")
        return 0.0, used
    rates = [signal.rate for signal in of_one_length if signal.rate is not None]
    if rates and max(rates) > min(rates) * (1 + SAME_RATE):
        ledger.faults.append(f"its channels differ in sample rate: {min(rates):g} and {max(rates):g} Hz")
        return 0.0, used
    size = of_one_length[0].values.size
    beside = [time for time in times if time.values.size == size]
    refuse_flaws([*used, *beside], ledger)
    by_axis = _rate_of_axis(beside, ledger)
    return _agreed(rates[0] if rates else by_axis, description.rate, ledger), used


def _rate_of_axis(times: Sequence[Signal], ledger: Ledger) -> float | None:
    """That of the time columns, which must agree; None where there is none whose unit is known."""
    if not times or any(time.flaws for time in times):
        return None
    size = times[0].values.size
    if size < 8:
        ledger.faults.append(f"{size} samples; at least 8 are needed")
        return None
    steps = [_step(np.asarray(time.values, dtype=np.float64), ledger) for time in times]
    if not all(steps):
        return None
    starts = [time.values[0] for time in times]
    if np.ptp(starts) > EVEN * steps[0] or np.ptp(steps) * size > steps[0]:
        ledger.faults.append(f"its time axes differ: they begin at {starts} with steps of {steps}")
        return None
    unit = unit_of(times[0].unit)
    if unit is None or unit.quantity != "time":
        return None
    return 1 / (steps[0] * unit.factor)


def _step(time: NDArray[np.float64], ledger: Ledger) -> float:
    """Of an even axis; 0 where it is none, which the ledger then says."""
    step, fault = step_of(time)
    if not fault:
        return step
    printed = printed_step(time) if step > 0 else None
    if printed is None:
        ledger.faults.append(f"{fault}; where the time alone is wrong leave it out of --columns and give --rate")
        return 0.0
    if FEW_DIGITS not in ledger.facts:
        ledger.facts.append(FEW_DIGITS)
    return printed


def _agreed(in_file: float | None, given: float | None, ledger: Ledger) -> float:
    if given is not None and not (np.isfinite(given) and given > 0):
        ledger.faults.append(f"--rate {given:g}: give the samples a second, > 0 Hz")
        return 0.0
    if in_file is not None and given is not None and abs(given / in_file - 1) > 0.01:
        ledger.contradict("--rate", f"{given:g}", f"{in_file:g} Hz")
        return 0.0
    if in_file is not None:
        ledger.know("sample rate", f"{in_file:.8g} Hz")
        return in_file
    if given is not None:
        ledger.know("sample rate", f"{given:.8g} Hz", "option")
        return given
    if not ledger.faults:
        ledger.ask("its sample rate, or the unit of its time", "--rate 51200")
    return 0.0


def _doubt_gravity(responses: Sequence[Signal], ledger: Ledger) -> None:
    """A resting sensor that shows 9.8 in a column called g holds m/s^2."""
    for signal in responses:
        offset = abs(float(np.median(signal.values))) if signal.values.size else 0.0
        if signal.unit.lower() == "g" and abs(offset - STANDARD_GRAVITY) < 0.5:
            ledger.faults.append(
                f"unit of {signal.name} in doubt (called g, rests at {offset:.2f}, which is gravity in m/s^2)"
            )


def in_their_unit(signals: Sequence[Signal], description: Description, ledger: Ledger) -> list[Signal]:
    """Values that are shares of a full scale, in their unit."""
    shares = [signal for signal in signals if signal.per_full_scale]
    if not shares:
        if description.full_scale:
            ledger.faults.append("--full-scale: its values are no shares of a full scale; leave it out")
        return list(signals)
    if len(description.full_scale) != len(shares):
        ledger.ask(f"the full scale of its {len(shares)} channels, in their order and units", "--full-scale 500,50")
        return list(signals)
    ledger.know("full scale", ", ".join(f"{factor:g}" for factor in description.full_scale), "option")
    scale = dict(zip((id(signal) for signal in shares), description.full_scale, strict=True))
    return [replace(signal, values=signal.values * scale.get(id(signal), 1.0)) for signal in signals]
