"""Command `lobewatch ack`: acknowledge alarms."""

from datetime import UTC, datetime
from typing import Annotated

from typer import Argument, Option

from lobewatch.commands.shared_options import LocalTime, Machine
from lobewatch.show.terminal.output import Json, emit


def ack(
    machine: Machine,
    alarm: Annotated[str, Argument(help="Alarm ID, or a unique part of it. Default: all open alarms.")] = "",
    until: Annotated[datetime | None, LocalTime(help="Time to repeat the alarm (local time). Default: never.")] = None,
    note: Annotated[str, Option(help="Note for your colleagues.")] = "",
    operator: Annotated[str, Option(help="Name of the operator. Default: login name.")] = "",
    as_json: Json = False,
) -> None:
    """Acknowledge alarms.

    An acknowledged alarm is not repeated, but the status of the machine stays. Only tap tests, or a new baseline after
    a repair, close an alarm. You are notified of each new alarm.

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
        closing = (
            "The status of the machine does not change. Tap tests, or a new baseline after a repair, close an alarm."
        )
        emit({"acknowledged": [known.to_row(now) for known in alarms]}, as_json, *texts, closing)
