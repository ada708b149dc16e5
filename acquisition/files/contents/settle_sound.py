"""The one acceleration over time in what a file holds and what a person adds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from acquisition.files.contents.contents import Contents
from acquisition.files.contents.description import Description
from acquisition.files.contents.ledger import Ledger
from acquisition.files.contents.named_columns import named_columns, names_of
from acquisition.files.contents.sensitivity import in_sensor_units
from acquisition.files.contents.settle_hits import in_their_unit, kind_of, rate_of
from acquisition.files.contents.settle_unit import chosen, response_unit

COLUMNS_SOUND = '--columns "time [s],acceleration [m/s^2]", in their order, or each with =NAME'
"""How an acceleration is named."""


def settle_sound(
    contents: Contents, description: Description, ledger: Ledger
) -> tuple[NDArray[np.float64], float] | None:
    """Acceleration (m/s^2), shape (n,), and sample rate (Hz); None where the ledger says what is missing or wrong."""
    signals = named_columns(contents.signals, description.columns, ledger) if description.columns else contents.signals
    scaled = in_sensor_units(in_their_unit(signals, description, ledger), description, ledger)
    if scaled is None or not ledger.is_clean:
        return None
    over_time = [signal for signal in scaled if signal.role not in ("time", "frequency", "ignored", "frf", "coherence")]
    heard = [signal for signal in over_time if kind_of(signal) == "response"]
    heard = heard or [signal for signal in over_time if not kind_of(signal)]
    if not heard:
        ledger.ask(f"which of its columns is the acceleration ({names_of(signals)})", COLUMNS_SOUND)
        return None
    signal = chosen(heard, description.response, "responses", ledger)
    unit = response_unit(signal, description, ledger) if signal is not None else None
    rate = rate_of(scaled, [signal] if signal is not None else (), description, ledger)
    if signal is None or unit is None or not ledger.is_clean:
        return None
    if unit[0] != "acceleration":
        ledger.faults.append(f"{signal.name} is a {unit[0]}; a cut is heard by an accelerometer")
        return None
    return np.asarray(signal.values * unit[1], dtype=np.float64), rate
