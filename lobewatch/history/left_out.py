"""What the tap tests say that a person has taken out: to be shown beside those that count, never among them."""

from __future__ import annotations

from collections.abc import Sequence

from lobewatch.history.history import Row, row_of
from lobewatch.machine import DamagedTapError, MachineFolder, TapEntry
from lobewatch.measuring.measurement import measure
from lobewatch.tool.assembly import assemble
from lobewatch.tool.order import Place


def left_out(folder: MachineFolder, excluded: Sequence[TapEntry], rows: Sequence[Row]) -> list[Row]:
    """Excluded tap tests of the series of these rows as rows of their own, without diagrams; damaged ones are skipped.

    rows: one series, oldest first, at least one. A tap test before its baseline is none of it.
    """
    rows_out = []
    for entry in excluded:
        if (entry.tool, entry.direction) != (rows[-1].tool, rows[-1].direction):
            continue
        try:
            tap = folder.read(entry)
        except DamagedTapError:
            continue
        time, baseline = tap.circumstances.created, rows[-1].baseline
        if baseline is None or time >= baseline:
            before = [row.mode for row in rows if row.time < time and row.mode is not None]
            measurement = measure(tap, folder.machine, before[-1] if before else None)
            rows_out.append(row_of(measurement, assemble(measurement, None, {}), Place(0, entry, None, None, baseline)))
    return rows_out
