"""The word of a person on alarms that are open: a line of the journal each."""

from __future__ import annotations

import getpass
from datetime import UTC, datetime

import msgspec

from acquisition import check_name
from lobewatch.decay.alarm import Alarm, choose_alarms
from lobewatch.logbook.logbook import Logbook
from lobewatch.machine.journal.acknowledgement import Acknowledgement


def acknowledge(
    logbook: Logbook, name: str = "", until: datetime | None = None, note: str = "", operator: str = ""
) -> list[Alarm]:
    """The alarm of this name, or all that ring, with the word that is now in the journal, for good.

    until: without a zone local time; operator: the name of the login where empty. ValueError where nothing rings or the
    name is of none, for an end that is past, and for a note that cannot be told again.
    """
    now = datetime.now(UTC)
    end = None if until is None else until.astimezone(UTC)
    if end is not None and end <= now:
        raise ValueError(f"--until {until}: is past; give the day on which it is to ring again")
    check_name(note, "note")
    check_name(operator, "operator")
    standing, baseline = logbook.standing(now), logbook.history.baseline
    newest, by = standing.last_tap or now, operator or _login_name()
    alarms = [
        msgspec.structs.replace(
            alarm,
            acknowledgement=Acknowledgement(
                alarm.code, alarm.about, alarm.raised_by, newest, baseline, now, by, end, note
            ),
        )
        for alarm in choose_alarms(standing.alarms, name, now)
    ]
    with logbook.folder.locked():
        logbook.folder.journal.append(*(alarm.acknowledgement.line for alarm in alarms if alarm.acknowledgement))
    return alarms


def _login_name() -> str:
    """Name of whoever is logged in; empty where the system does not say."""
    try:
        return getpass.getuser()
    except (OSError, KeyError, ImportError):
        return ""
