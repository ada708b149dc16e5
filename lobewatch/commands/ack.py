"""Command `lobewatch ack`: acknowledge alarms."""

from datetime import UTC, datetime
from typing import Annotated

from typer import Argument, Option

from lobewatch.commands.shared_options import Machine
from lobewatch.show.terminal.output import Json, emit


def ack(
    machine: Machine,
    alarm: Annotated[
        str, Argument(help="The alarm, or a part of its name that no other has; all that ring where not given.")
    ] = "",
    until: Annotated[
        datetime | None, Option(help="When it is to ring again, local time; never where not given.")
    ] = None,
    note: Annotated[str, Option(help="What is being done, for those who come next.")] = "",
    operator: Annotated[str, Option(help="Who says so; the name of the login where not given.")] = "",
    as_json: Json = False,
) -> None:
    """Acknowledge alarms.

    An alarm is closed by the tap tests alone, or by a new baseline after a repair; one that is raised anew rings again.

    Examples
    --------
      lobewatch ack mill-3
      lobewatch ack mill-3 decay:reference:x --until 2026-12-01 --note "bearings ordered"
    """
    from lobewatch.logbook import Logbook
    from lobewatch.logbook.operator_entries import acknowledge_alarms
    from lobewatch.notify.publish_status import publish_on_change

    with publish_on_change(Logbook.open(machine)) as logbook:
        alarms, now = acknowledge_alarms(logbook, alarm, until, note, operator), datetime.now(UTC)
        texts = [f"{known.id}: {known.acknowledgement}" for known in alarms]
        closing = "the light stays as it is: tap tests close an alarm, or a new baseline after a repair"
        emit({"acknowledged": [known.to_row(now) for known in alarms]}, as_json, *texts, closing)
