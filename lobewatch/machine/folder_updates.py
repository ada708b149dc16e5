"""Write events, exclusions, test cuts, mode edits, programs and accepted settings to a machine folder."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from importlib.metadata import version
from typing import Any, Literal

import msgspec

from acquisition.file_io import make_folder
from acquisition.files.cut_file import CutSignal, write_cut_signal
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import write_machine_file
from lobewatch.machine.journal.cut_entry import CUT_LINE_KIND, CutEntry, RecordingFile
from lobewatch.machine.journal.entries import (
    ExcludableEntry,
    MaintenanceEvent,
    find_excludable_entry,
    make_event,
    make_event_line,
    make_exclusion_line,
    make_inclusion_line,
    make_mode_edits_line,
    make_withdrawal_line,
    read_events,
)
from lobewatch.machine.journal.journal import JournalReading
from lobewatch.machine.settings.cut_tables import ProgramTable
from lobewatch.machine.settings.machine_file import REFERENCE_CUT, Machine, parse_machine_file
from lobewatch.machine.settings.plausibility import ImplausibleSetting
from lobewatch.machine.settings.requested_cut import CutSetting
from lobewatch.machine.settings.setting_questions import find_all_questions, find_template_bearings
from lobewatch.machine.settings.toml_text import TablePath, edit_toml
from modal import ModeEdits


def add_event(
    folder: MachineFolder, text: str, date: datetime | None = None, new_baseline: bool = False
) -> MaintenanceEvent:
    """Write down what was done to the machine; date: None for now, without a zone local time.

    ValueError for an event that makes no sense, BusyError where another program writes.
    """
    with folder.locked():
        now, entries = datetime.now(UTC), folder.journal.read().entries
        event = make_event(entries, folder.taps(), text, date, new_baseline, now)
        folder.journal.append(make_event_line(event, now))
    return event


def withdraw_event(folder: MachineFolder, event_id: str) -> MaintenanceEvent:
    """Take an event back; ValueError where there is none of that name."""
    with folder.locked():
        entries = folder.journal.read().entries
        line = make_withdrawal_line(entries, event_id, datetime.now(UTC))
        folder.journal.append(line)
    return next(event for event in read_events(entries) if event.id == event_id)


def exclude_entry(folder: MachineFolder, name: str, reason: str) -> ExcludableEntry:
    """Take a tap test out of the series, or a test cut out of what is learnt from.

    name: its identity, file, or a part that no other has.
    """
    with folder.locked():
        entry = _find_entry(folder, name)
        folder.journal.append(make_exclusion_line(entry, reason, datetime.now(UTC)))
    return entry


def include_entry(folder: MachineFolder, name: str) -> ExcludableEntry:
    """Take a tap test back into the series, or a test cut back into what is learnt from."""
    with folder.locked():
        entry = _find_entry(folder, name)
        folder.journal.append(make_inclusion_line(entry, datetime.now(UTC)))
    return entry


def _find_entry(folder: MachineFolder, name: str) -> ExcludableEntry:
    contents = folder.contents()
    return find_excludable_entry(name, [*contents.taps, *contents.lost], contents.cuts, str(folder.path))


def lobewatch_version() -> str:
    """Version of lobewatch."""
    return f"lobewatch {version('lobewatch')}"


def store_cut(folder: MachineFolder, cut: CutEntry, signal: CutSignal | None = None) -> CutEntry:
    """Write down a test cut, first its recording, then its line; saved for good when this returns.

    Returns it with its identity. DataError where the journal is damaged, BusyError where another program writes.
    """
    with folder.locked():
        reading = folder.refuse_damage()
        named = replace(cut, id=_next_cut_id(folder, reading))
        if signal is not None:
            path = folder.path / "cuts" / f"{named.id}.h5"
            make_folder(path.parent)
            content = write_cut_signal(path, signal, named.line)
            digest = hashlib.sha256(content).hexdigest()
            named = replace(named, recording=RecordingFile(named.id, digest, len(content)))
        folder.journal.append(named.line | {"time": datetime.now(UTC).isoformat()}, reading=reading)
    return named


def _next_cut_id(folder: MachineFolder, reading: JournalReading) -> str:
    """First identity that neither a line nor a file has had."""
    lines = [line["id"] for line in reading.other_entries if line["kind"] == CUT_LINE_KIND]
    files = [path.stem for path in (folder.path / "cuts").glob("c*.h5")]
    numbers = [int(name[1:]) for name in (*lines, *files) if name[1:].isdigit()]
    return f"c{max(numbers, default=0) + 1}"


def store_mode_edits(folder: MachineFolder, tap_ids: Sequence[str], edits: ModeEdits) -> None:
    """A line for each of these tap tests, saved for good when this returns; edits that say nothing take it back."""
    now = datetime.now(UTC)
    if tap_ids:
        with folder.locked():
            folder.journal.append(*(make_mode_edits_line(tap_id, edits, now) for tap_id in tap_ids))


TOOTH_FREQUENCY_TOLERANCE = 0.005
"""Share of a frequency: so near to a multiple of the tooth passing frequency it is the cut itself; chosen."""
SAME_SPEED_TOLERANCE, SAME_DEPTH_TOLERANCE = 2e-3, 1e-2
"""Relative differences up to which speeds and depths are one point; chosen."""


def make_observed_cut(
    setting: CutSetting,
    word: Literal["stable", "chatter"],
    frequency: float | None = None,
    at: datetime | None = None,
    now: datetime | None = None,
) -> CutEntry:
    """Test cut as a person has heard it; at: None for now. Not written down yet: it has no identity.

    frequency: of the chatter (Hz). ValueError for one that cannot be, and for a date in the future.
    """
    when = resolve_cutting_time(at, now or datetime.now(UTC))
    _check_chatter_frequency(setting, word, frequency)
    return CutEntry(
        "",
        when,
        **setting.cut_entry_fields(setting.speed_rpm),
        word=word,
        chatter_frequency_hz=frequency,
        by="ear",
        software=lobewatch_version(),
    )


def resolve_cutting_time(at: datetime | None, now: datetime) -> datetime:
    """Time of a cut (UTC); at: None for now, without a zone local time. ValueError for a date in the future."""
    when = now if at is None else at.astimezone(UTC)
    if when - now > timedelta(days=1):
        raise ValueError(f"--date {at}: lies in the future; give the day on which it was cut")
    return when


def _check_chatter_frequency(setting: CutSetting, word: str, frequency: float | None) -> None:
    if frequency is None:
        return
    if word == "stable":
        raise ValueError(f"--frequency {frequency:g}: a stable cut has none; leave it out, or say --chatter")
    if not 0 < frequency < 1e5:
        raise ValueError(f"--frequency {frequency:g}: is not above 0 and below 100000; give what was heard, in Hz")
    tooth = setting.tooth_frequency
    times = round(frequency / tooth)
    if times and abs(frequency - times * tooth) <= TOOTH_FREQUENCY_TOLERANCE * frequency:
        raise ValueError(
            f"--frequency {frequency:g}: is {times} times the tooth passing frequency of {tooth:g} Hz, which every cut "
            "sounds with; give the frequency of the chatter beside it, or leave --frequency out"
        )


def find_contradicting_cuts(cut: CutEntry, earlier: Sequence[CutEntry]) -> list[CutEntry]:
    """Earlier cuts that count and were heard otherwise at the same point."""
    return [
        old for old in earlier if old.is_usable and _is_same_setting(old, cut) and old.has_chatter != cut.has_chatter
    ]


def _is_same_setting(old: CutEntry, new: CutEntry) -> bool:
    same = (old.tool, old.cut, old.feed) == (new.tool, new.cut, new.feed)
    near_speed = abs(old.speed_rpm - new.speed_rpm) <= SAME_SPEED_TOLERANCE * new.speed_rpm
    return same and near_speed and abs(old.depth - new.depth) <= SAME_DEPTH_TOLERANCE * new.depth


LEADING_PROGRAM_KEYS = ("name", "tool")
"""Keys that stand first; the others as `ProgramTable` has them."""


def check_program_name(machine: Machine, name: str) -> None:
    """ValueError for a name that no new program can have."""
    if not name.strip():
        raise ValueError("--save: the name is empty; give the program a name")
    if name in (REFERENCE_CUT, *(program.name for program in machine.all_programs)):
        raise ValueError(f"--save {name}: a program of that name is in machine.toml; choose another name")


def save_program(folder: MachineFolder, program: ProgramTable) -> None:
    """Add a program behind the others; ValueError for a taken name, DataError where the file cannot be edited.

    Nothing is written unless all of the file can be read again.
    """
    with folder.locked():
        now = MachineFolder(folder.path)
        check_program_name(now.machine, program.name)
        place = TablePath("program", len(now.machine.all_programs))
        text = edit_toml(now.toml_text, place, _program_values(program))
        parse_machine_file(text, str(now.toml))
        write_machine_file(now.path, text)


def _program_values(program: ProgramTable) -> dict[str, Any]:
    """Name and tool, and what differs from the defaults."""
    given = {
        field.name: getattr(program, field.name)
        for field in msgspec.structs.fields(program)
        if field.name in LEADING_PROGRAM_KEYS or getattr(program, field.name) != field.default
    }
    return {key: given[key] for key in (*LEADING_PROGRAM_KEYS, *given) if key in given}


def accept_settings(folder: MachineFolder, keys: Sequence[str]) -> list[str]:
    """Write down that what is asked about these keys is right; the lines that are written.

    A key, or a whole line where several tables ask about it. ValueError, and nothing is written, for what is not asked.
    """
    asked = find_setting_questions(folder)
    accepted = list[str]()
    for key in keys:
        claims = [doubted.statement for doubted in asked if key in (doubted.key, doubted.statement)]
        if not claims:
            listed = "; ".join(doubted.statement for doubted in asked) or "none"
            raise ValueError(f"--accept {key}: nothing is asked about it; open questions: {listed}")
        accepted += claims
    lines = [*folder.machine.machine.accepted, *dict.fromkeys(accepted)]
    write_machine_file(folder.path, edit_toml(folder.toml_text, TablePath("machine"), {"accepted": lines}))
    return accepted


def find_setting_questions(folder: MachineFolder) -> list[ImplausibleSetting]:
    """All that machine.toml is asked about."""
    guessed = find_template_bearings(folder.machine)
    return [*find_all_questions(folder.machine), *([guessed] if guessed else [])]
