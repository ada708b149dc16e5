"""Write events, exclusions, test cuts, mode edits, programs and accepted settings to a machine folder."""

import hashlib
from collections.abc import Sequence
from dataclasses import asdict, replace
from datetime import UTC, datetime, timedelta
from importlib.metadata import version
from typing import Literal

import msgspec

from acquisition import HitDecision, check_name
from acquisition.file_io import make_folder
from acquisition.files.cut_file import CutSignal, write_cut_signal
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.journal import read_entries as lines
from lobewatch.machine.journal.entries import CUT_LINE_KIND, POWER_READING, CutEntry, RecordingFile
from lobewatch.machine.journal.join_lines import find_open_contradictions, next_identity
from lobewatch.machine.journal.journal import JournalReading, make_entry
from lobewatch.machine.journal.mass_checks import MASS_CHECK_KIND, MassCheckEntry
from lobewatch.machine.journal.tap_entry import TapEntry
from lobewatch.machine.settings.cut_tables import ProgramTable
from lobewatch.machine.settings.machine_file import REFERENCE_CUT, Machine, parse_machine_file
from lobewatch.machine.settings.requested_cut import CutSetting
from lobewatch.machine.settings.setting_questions import find_all_questions, find_template_bearings
from lobewatch.machine.settings.toml import TablePath, edit_toml
from lobewatch.machine.setup_questions.machine_file_changes import change_machine_file
from modal import ModeEdits

TOOTH_FREQUENCY_TOLERANCE = 0.005
"""Relative distance from a multiple of the tooth passing frequency within which a sound is not chatter; chosen."""
SAME_SPEED_TOLERANCE, SAME_DEPTH_TOLERANCE = 2e-3, 1e-2
"""Relative differences of speeds and depths within which two cuts count as the same point; chosen."""


def add_event(
    folder: MachineFolder, text: str, date: datetime | None = None, new_baseline: bool = False
) -> lines.MaintenanceEvent:
    """Write a maintenance event to the journal.

    date: None for now, local time without a zone, the whole day at midnight. Raises ValueError for an empty text, a
    date in the future, a duplicate, and a new baseline on a whole day with tap tests, whose order is then unknown;
    BusyError if another program writes.
    """
    with folder.locked():
        now, reading = datetime.now(UTC), folder.journal.read()
        if not text.strip():
            raise ValueError('the event has no text. Describe the work, such as "bearings replaced".')
        check_name(text, "event")
        time = now if date is None else _to_utc(date)
        if time - now > timedelta(days=1):
            raise ValueError(f"MaintenanceEvent.time {date} is in the future. Give the date of the work.")
        same = [
            event.id for event in lines.read_events(reading.other_entries) if (event.time, event.text) == (time, text)
        ]
        if same:
            raise ValueError(f"event {text!r} of {date} already exists as {same[0]}")
        if new_baseline and date is not None and date.time() == datetime.min.time():
            _refuse_tapped_day(folder.taps(), time)
        name = next_identity("event", reading.entries)
        event = lines.MaintenanceEvent(name, time, text, new_baseline)
        fields = {"id": event.id, "date": event.time.isoformat(), "text": text, "new_baseline": new_baseline}
        folder.journal.append(make_entry("event", now, **fields))
    return event


def _to_utc(date: datetime) -> datetime:
    try:
        return date.astimezone(UTC)
    except (OverflowError, ValueError) as error:
        raise ValueError(f"MaintenanceEvent.time {date} is out of range. Give a date after 1970-01-01.") from error


def _refuse_tapped_day(taps: Sequence[TapEntry], begin: datetime) -> None:
    tapped = [tap.created for tap in taps if begin <= tap.created < begin + timedelta(days=1)]
    if tapped:
        clock = ", ".join(f"{time.astimezone():%H:%M}" for time in tapped)
        day, cure = f"{begin.astimezone():%Y-%m-%d}", "Give the time of the new baseline too"
        raise ValueError(f"{day} has tap tests at {clock}. {cure}, such as MaintenanceEvent.time {day}T12:00:00.")


def withdraw_event(folder: MachineFolder, event_id: str) -> lines.MaintenanceEvent:
    """Withdraw an event; ValueError for an unknown identity."""
    with folder.locked():
        events = {event.id: event for event in lines.read_events(folder.journal.read().other_entries)}
        if event_id not in events:
            raise ValueError(f"no event {event_id}. Existing events: {', '.join(events) or 'none'}.")
        folder.journal.append(make_entry("event", withdraws=event_id))
    return events[event_id]


def exclude_entry(folder: MachineFolder, name: str, reason: str) -> lines.ExcludableEntry:
    """Exclude a tap test from its series, a test cut from learning, or a check with a known mass.

    name: identity, file, or a part of the identity that no other entry has. Raises ValueError if it is excluded, or
    without a reason.
    """
    with folder.locked():
        entry = _find_entry(folder, name)
        if entry.excluded and not _is_contested(folder, entry.id):
            raise ValueError(f"{entry.id} is already excluded, for {entry.excluded!r}")
        if not reason.strip():
            raise ValueError(
                f"{entry.id}: the reason for the exclusion is missing. Give the reason with exclude_entry.reason."
            )
        check_name(reason, "reason")
        folder.journal.append(make_entry("exclude", tap=entry.id, reason=reason))
    return entry


def include_entry(folder: MachineFolder, name: str) -> lines.ExcludableEntry:
    """Include an excluded tap test, test cut or mass check again; ValueError if it is not excluded."""
    with folder.locked():
        entry = _find_entry(folder, name)
        if not entry.excluded and not _is_contested(folder, entry.id):
            raise ValueError(f"{entry.id} is not excluded")
        folder.journal.append(make_entry("include", tap=entry.id))
    return entry


def _is_contested(folder: MachineFolder, name: str) -> bool:
    """Tell whether another computer entered something else on this subject, so that a person may confirm it."""
    return name in {found.about for found in find_open_contradictions(folder.journal.read().other_entries)}


def _find_entry(folder: MachineFolder, name: str) -> lines.ExcludableEntry:
    contents = folder.contents()
    others: list[CutEntry | MassCheckEntry] = [*contents.cuts, *contents.mass_checks]
    return lines.find_excludable_entry(name, [*contents.taps, *contents.lost], others, str(folder.path))


def store_mode_edits(folder: MachineFolder, tap_ids: Sequence[str], edits: ModeEdits) -> None:
    """Write the mode edits of tap tests to the journal; empty edits revoke earlier ones."""
    entries = [make_entry("modes", tap=tap_id, **asdict(edits)) for tap_id in tap_ids]
    if entries:
        with folder.locked():
            folder.journal.append(*entries)


def store_hit_decisions(folder: MachineFolder, tap_id: str, decisions: Sequence[HitDecision]) -> None:
    """Write decisions on hits of a tap test to the journal; the tap test may be in progress."""
    with folder.locked():
        folder.journal.append(*lines.make_hit_entries(tap_id, decisions))


def store_mass_check(folder: MachineFolder, check: MassCheckEntry) -> MassCheckEntry:
    """Write a check with a known mass to the journal, and return it with its identity."""
    with folder.locked():
        check = msgspec.structs.replace(check, id=next_identity(MASS_CHECK_KIND, folder.journal.read().entries))
        folder.journal.append(check.line)
    return check


def lobewatch_version() -> str:
    """Return the name and version of this program."""
    return f"lobewatch {version('lobewatch')}"


def store_cut(folder: MachineFolder, cut: CutEntry, signal: CutSignal | None = None) -> CutEntry:
    """Write a test cut, first its recording, then its journal line, and return it with its identity.

    Raises DataError if the journal is damaged, BusyError if another program writes.
    """
    with folder.locked():
        reading = folder.refuse_damage()
        cut = replace(cut, id=_next_cut_id(folder, reading))
        if signal is not None:
            path = folder.path / "cuts" / f"{cut.id}.h5"
            make_folder(path.parent)
            content = write_cut_signal(path, signal, cut.line)
            cut = replace(cut, recording=RecordingFile(cut.id, hashlib.sha256(content).hexdigest(), len(content)))
        folder.journal.append(cut.line | {"time": datetime.now(UTC).isoformat()}, reading=reading)
    return cut


def _next_cut_id(folder: MachineFolder, reading: JournalReading) -> str:
    return next_identity(CUT_LINE_KIND, reading.entries, (path.stem for path in (folder.path / "cuts").glob("c*.h5")))


ObservedWord = Literal["stable", "chatter", "cannot tell"]
"""Result of a cut that a person enters; "cannot tell" for a power only."""


def choose_word(is_stable: bool, has_chatter: bool, power_kw: float | None) -> ObservedWord:
    """Choose the result of an observed cut; ValueError for two results, or for none without a power (kW)."""
    if is_stable and has_chatter:
        raise ValueError("both of CutEntry.is_stable and CutEntry.has_chatter. Give one of the two options.")
    if not (is_stable or has_chatter or power_kw is not None):
        missing = "neither of CutEntry.is_stable and CutEntry.has_chatter, and no build_power_reading.power_kw"
        raise ValueError(f"{missing}. Give one of these options.")
    return "stable" if is_stable else "chatter" if has_chatter else "cannot tell"


def make_observed_cut(
    setting: CutSetting, word: ObservedWord, frequency: float | None = None, at: datetime | None = None
) -> CutEntry:
    """Make the entry of a cut that a person has observed; `store_cut` gives it its identity.

    word: "cannot tell" for a power reading without a verdict. frequency: of the chatter (Hz). at: time of the cut, None
    for now. Raises ValueError for a frequency that cannot be chatter, and for a date in the future.
    """
    when = resolve_cutting_time(at, datetime.now(UTC))
    _check_chatter_frequency(setting, word, frequency)
    fields = setting.cut_entry_fields(setting.speed_rpm)
    by, reason = ("display", POWER_READING) if word == "cannot tell" else ("ear", "")
    fields |= {"word": word, "chatter_frequency_hz": frequency, "by": by, "reason": reason}
    fields["software"] = lobewatch_version()
    return CutEntry("", when, **fields)


def resolve_cutting_time(at: datetime | None, now: datetime) -> datetime:
    """Return the time of a cut (UTC): now for None, local time without a zone; ValueError for the future."""
    when = now if at is None else at.astimezone(UTC)
    if when - now > timedelta(days=1):
        raise ValueError(f"CutEntry.at {at} is in the future. Give the date of the cut.")
    return when


def _check_chatter_frequency(setting: CutSetting, word: str, frequency: float | None) -> None:
    if frequency is None:
        return
    option = f"CutEntry.chatter_frequency_hz {frequency:g}"
    if word == "cannot tell":
        raise ValueError(f"{option} belongs to a cut that chatters. Give CutEntry.has_chatter too.")
    if word == "stable":
        raise ValueError(f"{option} contradicts a stable cut. Leave out the frequency, or give CutEntry.has_chatter.")
    if not 0 < frequency < 1e5:
        raise ValueError(f"{option} is not between 0 and 100000. Give the chatter frequency in Hz.")
    tooth = setting.tooth_frequency
    times = round(frequency / tooth)
    if times and abs(frequency - times * tooth) <= TOOTH_FREQUENCY_TOLERANCE * frequency:
        cure = "Give the chatter frequency, or leave the option out."
        raise ValueError(f"{option} is {times} times the tooth passing frequency {tooth:g} Hz. {cure}")


def find_contradicting_cuts(cut: CutEntry, earlier: Sequence[CutEntry]) -> list[CutEntry]:
    """Return the earlier usable cuts at the same point with the opposite result."""
    opposite = [old for old in earlier if old.is_usable and old.has_chatter != cut.has_chatter]
    same = [old for old in opposite if (old.tool, old.cut, old.feed) == (cut.tool, cut.cut, cut.feed)]
    same = [old for old in same if abs(old.speed_rpm - cut.speed_rpm) <= SAME_SPEED_TOLERANCE * cut.speed_rpm]
    return [old for old in same if abs(old.depth - cut.depth) <= SAME_DEPTH_TOLERANCE * cut.depth]


def check_program_name(machine: Machine, name: str) -> None:
    """Raise ValueError for an empty name or the name of another program."""
    if not name.strip():
        raise ValueError("ProgramTable.name is empty. Give the program a name.")
    if name in (REFERENCE_CUT, *(program.name for program in machine.all_programs)):
        raise ValueError(f"ProgramTable.name {name!r} is already in machine.toml. Choose another name.")


def save_program(folder: MachineFolder, program: ProgramTable) -> None:
    """Add a program to machine.toml, which keeps its comments and order.

    Name and tool come first, then all values that differ from the defaults. Raises ValueError for a used name,
    DataError if the file cannot be edited.
    """
    fields = msgspec.structs.fields(program)
    values = {field.name: value for field in fields if (value := getattr(program, field.name)) != field.default}

    def add_program(text: str) -> str:
        machine = parse_machine_file(text, str(folder.toml))
        check_program_name(machine, program.name)
        place = TablePath("program", len(machine.all_programs))
        text = edit_toml(text, place, {"name": program.name, "tool": program.tool} | values)
        parse_machine_file(text, str(folder.toml))
        return text

    change_machine_file(folder.path, add_program)


def accept_settings(folder: MachineFolder, keys: Sequence[str]) -> list[str]:
    """Accept the questions about these keys or statements in [machine] accepted, and return the accepted statements.

    Raises ValueError, and writes nothing, if there is no question about a key.
    """
    accepted = list[str]()

    def accept(text: str) -> str:
        machine = parse_machine_file(text, str(folder.toml))
        accepted[:] = _find_statements(machine, keys)
        known = [*machine.machine.accepted, *dict.fromkeys(accepted)]
        return edit_toml(text, TablePath("machine"), {"accepted": known})

    change_machine_file(folder.path, accept)
    return accepted


def _find_statements(machine: Machine, keys: Sequence[str]) -> list[str]:
    """Return the statements of the open questions about some keys."""
    template = find_template_bearings(machine)
    questions = [*find_all_questions(machine), *([template] if template else [])]
    accepted = list[str]()
    for key in keys:
        statements = [question.statement for question in questions if key in (question.key, question.statement)]
        if not statements:
            listed = ", ".join(question.statement for question in questions) or "none"
            raise ValueError(f"accept_settings.keys {key} answers no open question. Open questions: {listed}.")
        accepted += statements
    return accepted
