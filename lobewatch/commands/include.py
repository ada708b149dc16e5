"""Command `lobewatch include`: include an excluded entry again."""

from lobewatch.commands.shared_options import ExcludableEntry, Machine
from lobewatch.show.terminal.output import Json, emit


def include(machine: Machine, tap: ExcludableEntry, as_json: Json = False) -> None:
    """Include an excluded tap test, test cut or mass check again.

    Examples
    --------
      lobewatch include mill-3 20261102T0914
    """
    from lobewatch.logbook import Logbook
    from lobewatch.machine.folder_updates import include_entry as take_back
    from lobewatch.notify.publish_status import publish_on_change

    with publish_on_change(Logbook.open(machine)) as logbook:
        entry = take_back(logbook.folder, tap)
        emit({"included": entry.id}, as_json, f"included {entry.id}")
