"""The columns of a file as a person names them: `--columns`."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace

from acquisition.files.contents.contents import Signal
from acquisition.files.contents.heading import ROLES, name_and_unit, unit_by_name
from acquisition.files.contents.ledger import Ledger
from acquisition.files.contents.units import unit_of


def named_columns(signals: Sequence[Signal], columns: Sequence[str], ledger: Ledger) -> tuple[Signal, ...]:
    """The signals with the roles and units that `columns` gives them, in its order; what it leaves out is left out.

    "time [s]" names the next column, "frf [m/N]=H1" the signal of this name, heading, unit or number, "frf=H:2" the
    second column of H.
    """
    named = list[Signal]()
    in_order = not any("=" in text for text in columns)
    if in_order and len(columns) < len(signals):
        ledger.faults.append(
            f"--columns names {len(columns)} of its {len(signals)} columns, which are {names_of(signals)}; name all in "
            'their order, "-" for what is left out, or each as in "real=2"'
        )
    for number, text in enumerate(columns):
        heading, _, name = text.partition("=")
        signal = _signal(signals, name.strip(), number, ledger)
        word, unit = name_and_unit(heading.strip())
        role = ROLES.get(word.strip().lower())
        if role is None:
            ledger.faults.append(f"--columns {text!r}: {word!r} is none of {', '.join(ROLES)}")
        elif signal is not None and role[0] != "ignored":
            unit = unit_by_name(word, unit or signal.unit)
            if any(signal.values is other.values for other in named):
                ledger.faults.append(f"--columns {text!r}: {signal.name} is named twice; name each column once")
            named.append(replace(signal, role=role[0], quantity=role[1] or signal.quantity, unit=unit, record=0))
    return tuple(named)


def _signal(signals: Sequence[Signal], name: str, number: int, ledger: Ledger) -> Signal | None:
    if not name and number < len(signals):
        return signals[number]
    if name:
        return column_called(signals, name, "--columns", ledger)
    ledger.faults.append(f"--columns: no column {number + 1} in the file, which holds {names_of(signals)}")
    return None


def column_called(signals: Sequence[Signal], name: str, option: str, ledger: Ledger) -> Signal | None:
    """That of a name, heading, unit or number; None where there is none or are several, which the ledger says."""
    meant = _called(signals, name)
    if len(meant) == 1:
        return meant[0]
    names = names_of(signals)
    if meant:
        numbers = ", ".join(f"{i}" for i, signal in enumerate(signals, 1) if signal in meant)
        ledger.faults.append(f"{option}: {len(meant)} columns are called {name!r}; say which by its number, {numbers}")
    else:
        ledger.faults.append(f"{option}: nothing called {name!r} in the file, which holds {names}")
    return None


def _called(signals: Sequence[Signal], name: str) -> Sequence[Signal]:
    """Those of a name, else shown so, of this number, of this unit."""
    unit = unit_of(name)
    tests: tuple[Callable[[int, Signal], bool], ...] = (
        lambda _, signal: signal.name == name,
        lambda _, signal: name in (_shown(signal), f"{_shown(signal)} ({signal.values.size})"),
        lambda _, signal: bool(signal.unit) and name_and_unit(name) == (signal.name, signal.unit),
        lambda _, signal: re.fullmatch(rf"{re.escape(name)}:\d+", signal.name) is not None,
        lambda number, _: name == str(number),
        lambda _, signal: (
            bool(signal.unit) and (signal.unit == name or (unit is not None and unit_of(signal.unit) == unit))
        ),
    )
    for test in tests:
        if meant := [signal for number, signal in enumerate(signals, 1) if test(number, signal)]:
            return meant
    return []


def names_of(signals: Sequence[Signal], most: int = 12) -> str:
    """What a file holds, for a sentence: names with units, and with how long they are where they differ in that."""
    with_size = len({signal.values.size for signal in signals}) > 1
    whole = [f"{_shown(signal)} ({signal.values.size})" if with_size else _shown(signal) for signal in signals]
    return ", ".join(whole[:most]) + (f" and {len(whole) - most} more" if len(whole) > most else "")


def _shown(signal: Signal) -> str:
    text = f"{signal.name} [{signal.unit}]" if signal.unit else signal.name
    return re.sub(r"\s+", " ", text)
