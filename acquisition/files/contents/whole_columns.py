"""Columns of one table that are used together: cut where the first of them ends, refused for what a cell lacks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from acquisition.files.contents.contents import Signal
from acquisition.files.contents.ledger import Ledger


def cut_to_shortest(
    used: Sequence[Signal], axes: Sequence[Signal], ledger: Ledger
) -> tuple[list[Signal], list[Signal]]:
    """Columns and their axes cut to where the first of them ends, which the ledger tells; others as they are.

    Of several axes only the longest counts: the others may be those of other columns.
    """
    by_size = sorted([*used, *sorted(axes, key=_size)[-1:]], key=_size)
    if not by_size or not all(_is_of_one_table(column, by_size[0]) for column in by_size):
        return list(used), list(axes)
    shortest, n = by_size[0], _size(by_size[0])
    if _size(by_size[-1]) > n:
        ledger.know("rows", f"{n} of {_size(by_size[-1])}, as {shortest.name} ends there", "default")
    cut = [[replace(column, values=column.values[:n]) for column in columns] for columns in (used, axes)]
    return cut[0], cut[1]


def is_beside(one: Signal, other: Signal) -> bool:
    """Whether two signals of a record have their values at the same places: in one table, or as many."""
    return one.record == other.record and (_is_of_one_table(one, other) or one.values.shape == other.values.shape)


def refuse_flaws(used: Sequence[Signal], ledger: Ledger, first: int = 0) -> None:
    """A fault for each column with a flaw from this place on."""
    for column in used:
        flaw = next((flaw for place, flaw in column.flaws.items() if first <= place < _size(column)), "")
        if flaw:
            ledger.faults.append(f"{column.name} {flaw}; mend it there, or leave {column.name} out of --columns")


def _is_of_one_table(one: Signal, other: Signal) -> bool:
    return one.n_rows == other.n_rows != 0


def _size(signal: Signal) -> int:
    return signal.values.size
