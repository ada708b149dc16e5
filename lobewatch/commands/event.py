"""Command `lobewatch event`: record maintenance of a machine."""

from datetime import datetime
from typing import Annotated

from typer import Argument, Option

from lobewatch.commands.shared_options import LocalTime, Machine
from lobewatch.show.terminal.output import Json, emit


def event(
    machine: Machine,
    text: Annotated[str, Argument(help="Description of the work, not needed with --withdraw.")] = "",
    date: Annotated[datetime | None, LocalTime(help="Date of the work (local time). Default: now.")] = None,
    new_baseline: Annotated[
        bool, Option("--new-baseline", help="Compare later tap tests with the first tap test after --date.")
    ] = False,
    withdraw: Annotated[str, Option(help="ID of an event to withdraw, such as e2.")] = "",
    as_json: Json = False,
) -> None:
    """Store or withdraw a maintenance event.

    The journal keeps every event, and a line for each withdrawal. lobewatch history lists the events.

    Examples
    --------
      lobewatch event mill-3 "bearings replaced" --date 2026-11-02 --new-baseline
      lobewatch event mill-3 "coolant pump replaced" --date 2026-11-02T14:30
      lobewatch event mill-3 --withdraw e2
    """
    from lobewatch.logbook import Logbook
    from lobewatch.machine import MachineFolder
    from lobewatch.machine.folder_updates import add_event, withdraw_event
    from lobewatch.notify.publish_status import publish_on_change
    from lobewatch.show.history import event_json, event_text

    folder = MachineFolder(machine)
    if withdraw and (text or date or new_baseline):
        raise ValueError(f"--withdraw {withdraw} cannot be used with TEXT, --date or --new-baseline. Omit these.")
    with publish_on_change(Logbook(folder)):
        if withdraw:
            gone = withdraw_event(folder, withdraw)
            emit({"withdrawn": event_json(gone)}, as_json, f"withdrawn {event_text(gone)}")
            return
        done = add_event(folder, text, date, new_baseline)
        next_step = ["Next: run a tap test, the baseline for all later tests."] if new_baseline else []
        emit({"event": event_json(done)}, as_json, f"saved {event_text(done)}", *next_step)
