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


def settle_sound(contents: Contents, said: Description, ledger: Ledger) -> tuple[NDArray[np.float64], float] | None:
    """Acceleration (m/s^2), shape (n,), and sample rate (Hz); None where the ledger says what is missing or wrong."""
    signals = named_columns(contents.signals, said.columns, ledger) if said.columns else contents.signals
    scaled = in_sensor_units(in_their_unit(signals, said, ledger), said, ledger)
    if scaled is None or not ledger.is_clean:
        return None
    over_time = [one for one in scaled if one.role not in ("time", "frequency", "ignored", "frf", "coherence")]
    heard = [one for one in over_time if kind_of(one) == "response"]
    heard = heard or [one for one in over_time if not kind_of(one)]
    if not heard:
        ledger.ask(f"which of its columns is the acceleration ({names_of(signals)})", COLUMNS_SOUND)
        return None
    one = chosen(heard, said.response, "responses", ledger)
    unit = response_unit(one, said, ledger) if one is not None else None
    rate = rate_of(scaled, [one] if one is not None else (), said, ledger)
    if one is None or unit is None or not ledger.is_clean:
        return None
    if unit[0] != "acceleration":
        ledger.faults.append(f"{one.name} is a {unit[0]}; a cut is heard by an accelerometer")
        return None
    return np.asarray(one.values * unit[1], dtype=np.float64), rate
