"""What heard a cut in what a file holds and what a person adds: accelerations over time, or a microphone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from acquisition.files.contents.contents import Contents, Signal
from acquisition.files.contents.description import Description
from acquisition.files.contents.ledger import Ledger
from acquisition.files.contents.named_columns import named_columns, names_of
from acquisition.files.contents.sensitivity import in_sensor_units
from acquisition.files.contents.settle_hits import in_their_unit, kind_of, rate_of
from acquisition.files.contents.settle_speed import settle_speed, speed_column
from acquisition.files.contents.settle_unit import chosen, response_unit

COLUMNS_SOUND = '--columns "time [s],acceleration [m/s^2]", in their order, or each with =NAME'
"""How an acceleration is named."""
MICROPHONE = "microphone"
"""Sensor whose values need no unit: what is told rests on how loud one is beside another."""


def settle_sound(
    contents: Contents, description: Description, ledger: Ledger
) -> tuple[NDArray[np.float64], float, NDArray[np.float64] | None] | None:
    """What heard a cut, its sample rate (Hz), and the speed of the spindle where the file has it (rpm, shape (n,)).

    None where the ledger says what is missing or wrong.

    Acceleration in m/s^2, a microphone in what the file holds: shape (n,), or (responses, n) where there are several
    and nobody says which is meant.
    """
    named = named_columns(contents.signals, description.columns, ledger) if description.columns else contents.signals
    signals, turning = speed_column(named, description, ledger)
    is_microphone = description.sensor == MICROPHONE
    in_units = (
        list(signals) if is_microphone and not description.full_scale else in_their_unit(signals, description, ledger)
    )
    scaled = in_sensor_units(in_units, description, ledger)
    if scaled is None or not ledger.is_clean:
        return None
    over_time = [signal for signal in scaled if signal.role not in ("time", "frequency", "ignored", "frf", "coherence")]
    responses = [signal for signal in over_time if kind_of(signal) == "response"]
    heard = responses or [signal for signal in over_time if not kind_of(signal)]
    if not heard:
        ledger.ask(f"which of its columns is the acceleration ({names_of(signals)})", COLUMNS_SOUND)
        return None
    meant = [chosen(heard, description.response, "responses", ledger)] if description.response is not None else heard
    settled = [signal for signal in meant if signal is not None]
    factors = [1.0 if is_microphone else _factor(signal, description, ledger) for signal in settled]
    beside = [turning] if turning is not None and settled else []
    rate, used = rate_of(scaled, [*settled, *beside], description, ledger)
    if is_microphone and responses:
        ledger.faults.append(f"{responses[0].name} moves; leave --sensor microphone out")
    if not settled or not ledger.is_clean:
        return None
    settled, beside = used[: len(settled)], used[len(settled) :]
    speed = settle_speed(beside[0], rate, description, ledger) if beside else None
    if not ledger.is_clean:
        return None
    values = np.stack([signal.values * factor for signal, factor in zip(settled, factors, strict=True)])
    return np.asarray(values if len(settled) > 1 else values[0], dtype=np.float64), rate, speed


def _factor(signal: Signal, description: Description, ledger: Ledger) -> float:
    """Of an acceleration, to m/s^2; 0 where it is none, or its unit is not known."""
    unit = response_unit(signal, description, ledger)
    if unit is None:
        return 0.0
    if unit[0] != "acceleration":
        ledger.faults.append(f"{signal.name} is a {unit[0]}; a cut is heard by an accelerometer")
    return unit[1]
