"""lobewatch rebuild."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lobewatch.machine.named_folder import named_folder
from lobewatch.show.output import Json, emit, notes


def rebuild(
    machine: Annotated[Path, typer.Argument(parser=named_folder, help="Machine folder.")],
    as_json: Json = False,
) -> None:
    """The history anew from the tap tests, and the journal where that is damaged; nothing is deleted.

    What is damaged is put into a folder named damaged. Tap files that were renamed or swapped get their names back,
    whole ones that are in no journal are entered. A tap test whose file is lost is gone on without; put back from a
    backup, it counts again.

    Examples:

      lobewatch rebuild mill-3
    """
    from lobewatch.analysis import Logbook
    from lobewatch.machine.archive.rebuild import rebuild_files
    from lobewatch.notify.telling import tell
    from lobewatch.show.measurements import remark_json, remark_lines

    told = rebuild_files(machine)
    logbook = Logbook.open(machine)
    logbook.folder.history.unlink(missing_ok=True)
    rows = logbook.history.rows
    for number, row in enumerate(rows, 1):
        logbook.rulings(row.tap_id)
        if number % 10 == 0:
            notes.print(f"{number} of {len(rows)} tap tests")
    if any(one.code == "history-in-memory" for one in logbook.remarks):
        made = "history.rows: not made anew (see above); the next command that can write makes it"
    else:
        made = f"history.rows: made anew from {len(rows)} tap test(s)"
    payload = {"done": told, "tap_tests": len(rows), "remarks": [remark_json(one) for one in logbook.remarks]}
    emit(payload, as_json, *told, *remark_lines(logbook.remarks), made)
    tell(logbook)
