"""How fast the spindle turns beside a cut: a column with its speed, or the pulses of a tachometer."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from acquisition.estimation.spindle_speed import speed_of_pulses
from acquisition.files.contents.contents import Signal
from acquisition.files.contents.description import Description
from acquisition.files.contents.ledger import Ledger
from acquisition.files.contents.named_columns import column_called
from acquisition.files.contents.units import unit_of

TACHO = ("speed", "tacho")
"""Roles of a column of the speed."""


def speed_column(
    signals: Sequence[Signal], description: Description, ledger: Ledger
) -> tuple[list[Signal], Signal | None]:
    """The signals without that of the speed, and that one; None where there is none."""
    columns = [signal for signal in signals if signal.role in TACHO]
    if description.tacho:
        named = column_called(signals, description.tacho, "--tacho", ledger)
        columns = [] if named is None else [named]
    if len(columns) > 1:
        names = " and ".join(signal.name for signal in columns)
        ledger.ask(f"which of {names} is the speed of the spindle", f'--tacho "{columns[0].name}"')
    rest = [signal for signal in signals if not (signal.role in TACHO or any(signal is column for column in columns))]
    if description.pulses is not None and not columns:
        ledger.faults.append(f"--pulses {description.pulses}: no column is a tachometer; name it with --tacho")
    return rest, columns[0] if columns else None


def settle_speed(
    signal: Signal, sample_rate: float, description: Description, ledger: Ledger
) -> NDArray[np.float64] | None:
    """Spindle speed at each sample (rpm), NaN where it is not known; None where the ledger says what is wrong."""
    unit, values = unit_of(signal.unit), np.asarray(signal.values, dtype=np.float64)
    if signal.role == "speed" and (unit is None or unit.quantity != "frequency"):
        ledger.ask(f"the unit of the speed in {signal.name}", f'--columns "speed [rpm]={signal.name}"')
        return None
    if unit is not None and unit.quantity == "frequency":
        return _speed_itself(signal, values, 60 * unit.factor, description, ledger)
    try:
        return speed_of_pulses(values, sample_rate, 1 if description.pulses is None else description.pulses)
    except ValueError as error:
        ledger.faults.append(f"{signal.name}: {error}")
        return None


def _speed_itself(
    signal: Signal, values: NDArray[np.float64], factor: float, description: Description, ledger: Ledger
) -> NDArray[np.float64] | None:
    """factor: rpm per unit."""
    if description.pulses is not None:
        ledger.faults.append(
            f"--pulses {description.pulses}: {signal.name} is the speed itself ({signal.unit}); leave it out"
        )
        return None
    speed = np.abs(values) * factor
    if not np.any(speed > 0):
        ledger.faults.append(
            f"{signal.name}: stands at 0 {signal.unit} all along; name another column, or leave it out"
        )
        return None
    return np.where(speed > 0, speed, np.nan)
