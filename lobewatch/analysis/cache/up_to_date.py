"""The history of a machine brought up to date: stored rows as far as they still hold, all others worked out anew."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from lobewatch.analysis.assembly import Assembly, lobes_of
from lobewatch.analysis.cache.history_cache import stored_history
from lobewatch.analysis.damage.usable import UsableTaps
from lobewatch.analysis.history import History, Row, row_of, without_last_word
from lobewatch.analysis.measurement import Measurement
from lobewatch.analysis.order import Place
from lobewatch.machine import MachineFolder

Measured = Callable[[Place, Sequence[Row]], Measurement]
Assembled = Callable[[Place, Sequence[Row]], Assembly]


def up_to_date(folder: MachineFolder, files: UsableTaps, measured: Measured, assembled: Assembled) -> History:
    """A row for each tap test that can be used.

    measured, assembled: what a tap test says, and its tool after it; from the rows before it.
    """
    history = stored_history(folder, files.places, files.baseline)
    rows = list(history.rows)
    for place in files.places[len(rows) :]:
        assembly = assembled(place, rows)
        rows.append(row_of(measured(place, rows), lobes_of(assembly, folder.machine), assembly.remarks, place))
    history = replace(history, rows=tuple(rows))
    return without_last_word(history) if rows and files.doubts() else history
