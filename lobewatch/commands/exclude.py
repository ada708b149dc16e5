"""Command `lobewatch exclude`: exclude a tap test from its series."""

from typing import Annotated

from typer import Option

from lobewatch.commands.shared_options import ExcludableEntry, Machine
from lobewatch.show.terminal.output import Json, emit


def exclude(
    machine: Machine,
    tap: ExcludableEntry,
    reason: Annotated[str, Option(help="Reason for the exclusion.")],
    as_json: Json = False,
) -> None:
    """Exclude a tap test, test cut or mass check from all results.

    The file is kept. lobewatch include undoes the exclusion.

    Examples
    --------
      lobewatch exclude mill-3 20261102T0914 --reason "wrong tool in the spindle"
    """
    from lobewatch.logbook import Logbook
    from lobewatch.machine.folder_updates import exclude_entry as take_out
    from lobewatch.notify.publish_status import publish_on_change

    with publish_on_change(Logbook.open(machine)) as logbook:
        entry = take_out(logbook.folder, tap, reason)
        payload = {"excluded": entry.id, "reason": reason}
        emit(payload, as_json, f"excluded {entry.id}", f"Undo: lobewatch include {machine} {entry.id}")
