"""Store operator entries: acknowledged alarms and modes edited by hand."""

from __future__ import annotations

import getpass
from collections.abc import Sequence
from datetime import UTC, datetime

import msgspec

from acquisition import check_name
from lobewatch.logbook.logbook import Logbook
from lobewatch.logbook.recordings.store_recordings import group_by_message
from lobewatch.machine.journal.entries import Acknowledgement, find_excludable_entry
from lobewatch.measurement import FileModes, fit_file_modes
from lobewatch.monitoring.alarm import Alarm, select_alarms
from modal import ModeEdits


def acknowledge_alarms(
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
    standing, baseline = logbook.status(now), logbook.history.baseline
    newest, by = standing.last_tap or now, operator or _get_login_name()
    alarms = [
        msgspec.structs.replace(
            alarm,
            acknowledgement=Acknowledgement(
                alarm.code, alarm.about, alarm.triggered_by, newest, baseline, now, by, end, note
            ),
        )
        for alarm in select_alarms(standing.alarms, name, now)
    ]
    with logbook.folder.locked():
        logbook.folder.journal.append(*(alarm.acknowledgement.line for alarm in alarms if alarm.acknowledgement))
    return alarms


def _get_login_name() -> str:
    """Name of whoever is logged in; empty where the system does not say."""
    try:
        return getpass.getuser()
    except (OSError, KeyError, ImportError):
        return ""


def read_tap_modes(logbook: Logbook, name: str, edits: ModeEdits | None = None) -> FileModes:
    """Modes of a tap test; name: its identity, file, or a part that no other has.

    edits: kept for it from now on in place of what was said before; None: nothing changes. ValueError, and nothing is
    kept, where they cannot be done; DataError where its file is damaged.
    """
    entries = [*logbook.files.by_id.values()]
    tap = find_excludable_entry(name, entries, (), str(logbook.folder.path))
    if edits is not None:
        reasons = logbook.edit_modes([tap.id], edits)
        if reasons:
            raise ValueError(f"{reasons[tap.id]}; nothing is kept")
    now = logbook.files.by_id[tap.id]
    logbook.folder.read(now)
    return fit_file_modes(logbook.folder.path / now.file, by_hand=now.by_hand, sensor=logbook.machine.tap.sensor)


def resolve_edits(edits: ModeEdits, by_fit: bool) -> ModeEdits | None:
    """Edits to be kept, empty ones where all is taken back; None where nothing changes. ValueError for both."""
    if edits and by_fit:
        raise ValueError("--by-fit takes back all that is said by hand; leave --add, --drop and --fix out")
    return edits if edits or by_fit else None


def store_edits(logbook: Logbook, tap_ids: Sequence[str], edits: ModeEdits) -> str:
    """Keep what is said of the modes of these tap tests, if anything; a text on those that it cannot be done of."""
    reasons = logbook.edit_modes(tap_ids, edits) if edits else {}
    return "\n".join(["stored without:", *group_by_message(reasons.items())]) if reasons else ""


def reject_edits(edits: ModeEdits) -> None:
    """ValueError where something is said of modes though nothing is stored."""
    if edits:
        raise ValueError(f"{edits}: with --dry-run nothing is kept; lobewatch modes FILE shows what becomes of it")
