"""Store operator entries: acknowledged alarms and modes edited by hand."""

import getpass
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime

import msgspec

from acquisition import Description, HitDecision, check_name
from acquisition.errors import join_sentences
from lobewatch.logbook.logbook import Logbook
from lobewatch.logbook.recordings.store_recordings import group_by_message
from lobewatch.machine.journal.alarm_entries import Acknowledgement
from lobewatch.machine.journal.read_entries import find_excludable_entry
from lobewatch.measurement import FileModes, fit_file_modes
from lobewatch.measurement.tap_measurement import EDITS_NOT_APPLIED_CODE, fit_tap
from lobewatch.monitoring.status_rules import Alarm, select_alarms
from modal import ModeEdits


def acknowledge_alarms(
    logbook: Logbook, name: str = "", until: datetime | None = None, note: str = "", operator: str = ""
) -> list[Alarm]:
    """Acknowledge one alarm by name, or all active alarms, permanently.

    `until` ends the acknowledgement (local time without a zone). `operator` defaults to the login name. ValueError if
    no alarm matches, if the end is past, and for a note that cannot be stored.
    """
    now = datetime.now(UTC)
    end = None if until is None else until.astimezone(UTC)
    if end is not None and end <= now:
        raise ValueError(f"acknowledge_alarms.until {until} is in the past. Give the date of the next reminder.")
    check_name(note, "note")
    check_name(operator, "operator")
    status, baseline = logbook.status(now), logbook.history.baseline
    said = status.last_tap or now, baseline, now, operator or _get_login_name(), end, note
    chosen = select_alarms(status.alarms, name, now)
    entries = [Acknowledgement(alarm.code, alarm.about, alarm.triggered_by, *said) for alarm in chosen]
    with logbook.folder.locked():
        logbook.folder.journal.append(*(entry.line for entry in entries))
    known = zip(chosen, entries, strict=True)
    return [msgspec.structs.replace(alarm, acknowledgement=entry) for alarm, entry in known]


def _get_login_name() -> str:
    """Return the login name, or an empty text if the system has none."""
    try:
        return getpass.getuser()
    except (OSError, KeyError, ImportError):
        return ""


def read_tap_modes(
    logbook: Logbook, name: str, edits: ModeEdits | None = None, decisions: Sequence[HitDecision] = ()
) -> FileModes:
    """Fit the modes of a tap test, after storing decisions on its hits and edits of its modes if there are any.

    `name` is the identity of the tap test, its file, or a unique part of either. ValueError if a decision or the edits
    do not fit; these are not stored then. DataError if the file is damaged.
    """
    entries = [*logbook.files.by_id.values()]
    tap = find_excludable_entry(name, entries, (), str(logbook.folder.path))
    if edits and decisions:
        fit = fit_tap(logbook.read_decided(tap.id, decisions), logbook.machine, edits)
        _refuse_reasons(remark.text for remark in fit.remarks if remark.code == EDITS_NOT_APPLIED_CODE)
    logbook.decide_hits(tap.id, decisions)
    if edits is not None:
        _refuse_reasons(logbook.edit_modes([tap.id], edits).values())
    tap = logbook.files.by_id[tap.id]
    logbook.folder.read(tap)
    path, sensor = logbook.folder.path / tap.file, logbook.machine.tap.sensor
    known = Description(hit_decisions=tap.hit_decisions)
    return fit_file_modes(path, description=known, by_hand=tap.by_hand, sensor=sensor)


def _refuse_reasons(reasons: Iterable[str]) -> None:
    for reason in reasons:
        raise ValueError(join_sentences(reason, "Nothing was stored"))


def store_edits(logbook: Logbook, tap_ids: Sequence[str], edits: ModeEdits) -> str:
    """Store edits of the modes of tap tests. Return a text on the tap tests that the edits do not fit."""
    reasons = logbook.edit_modes(tap_ids, edits) if edits else {}
    lines = ["tap tests stored without the mode edits:", *group_by_message(reasons.items())]
    return "\n".join(lines) if reasons else ""
