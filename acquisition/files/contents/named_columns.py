"""The columns of a file as a person names them: `--columns`."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from acquisition.files.contents.contents import Signal
from acquisition.files.contents.heading import ROLES, name_and_unit
from acquisition.files.contents.ledger import Ledger


def named_columns(signals: Sequence[Signal], columns: Sequence[str], ledger: Ledger) -> tuple[Signal, ...]:
    """The signals with the roles and units that `columns` gives them, in its order; what it leaves out is left out.

    "time [s]" names the next column, "frf [m/N]=H1" a signal of this name, "frf=H:2" the second column of H.
    """
    named = list[Signal]()
    for number, text in enumerate(columns):
        heading, _, name = text.partition("=")
        signal = _signal(signals, name.strip(), number, ledger)
        word, unit = name_and_unit(heading.strip())
        role = ROLES.get(word.strip().lower())
        if role is None:
            ledger.faults.append(f"--columns {text!r}: {word!r} is none of {', '.join(ROLES)}")
        elif signal is not None and role[0] != "ignored":
            unit = unit or ("dB" if word.lower() == "db" else "") or signal.unit
            named.append(replace(signal, role=role[0], quantity=role[1] or signal.quantity, unit=unit, record=0))
    return tuple(named)


def _signal(signals: Sequence[Signal], name: str, number: int, ledger: Ledger) -> Signal | None:
    if not name and number < len(signals):
        return signals[number]
    same = [signal for signal in signals if signal.name == name or (name and signal.name == f"{name}:1")]
    if same:
        return same[0]
    names = names_of(signals)
    wanted = f"nothing called {name!r}" if name else f"no column {number + 1}"
    ledger.faults.append(f"--columns: {wanted} in the file, which holds {names}")
    return None


def names_of(signals: Sequence[Signal], most: int = 12) -> str:
    """What a file holds, for a sentence: names with units, or with how long they are."""
    plain = [
        f"{signal.name} [{signal.unit}]" if signal.unit else f"{signal.name} ({signal.values.size})"
        for signal in signals
    ]
    whole = [re.sub(r"\s+", " ", text) for text in plain]
    return ", ".join(whole[:most]) + (f" and {len(whole) - most} more" if len(whole) > most else "")
