"""Tap tests, test cuts, events and mass checks that all lines of a journal give together."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import datetime
from operator import attrgetter
from typing import Any

import msgspec

from acquisition import HitDecision
from acquisition.hit_quality.decide_hits import merge_decisions
from lobewatch.machine.journal.entries import CUT_LINE_KIND, CutEntry, parse_cut_line
from lobewatch.machine.journal.journal import JournalEntry, JournalReading, make_entry
from lobewatch.machine.journal.line_formats import HIT_LINE_KIND
from lobewatch.machine.journal.mass_checks import MASS_CHECK_KIND, MassCheckEntry
from lobewatch.machine.journal.tap_entry import FIELDS_OF_OTHER_LINES, NO_MODE_EDITS, TapEntry, decode_tap_entries
from modal import ModeEdits


@dataclass(frozen=True)
class MaintenanceEvent:
    """Maintenance of the machine."""

    id: str
    """Identity in the journal, "e1" on."""
    time: datetime
    """Time of the maintenance (UTC)."""
    text: str
    """Description of the work."""
    new_baseline: bool
    """True if later tap tests are compared with none before it."""


def read_events(entries: Sequence[Mapping[str, Any]]) -> tuple[MaintenanceEvent, ...]:
    """Read the events of a journal that are not withdrawn, oldest first."""
    events: dict[str, MaintenanceEvent] = {}
    for line in entries:
        if line["kind"] == "event" and "withdraws" in line:
            events.pop(line["withdraws"], None)
        elif line["kind"] == "event":
            time = datetime.fromisoformat(line["date"])
            events[line["id"]] = MaintenanceEvent(line["id"], time, line["text"], line["new_baseline"])
    return tuple(sorted(events.values(), key=lambda event: event.time))


ExcludableEntry = TapEntry | CutEntry | MassCheckEntry
"""Entry that can be excluded."""


def find_excludable_entry(
    name: str, taps: Sequence[TapEntry], others: Sequence[CutEntry | MassCheckEntry], path: str
) -> ExcludableEntry:
    """Find the test cut or mass check of an identity, or the tap test of an identity, a part of it, or a file.

    Raises ValueError if there is none or there are several.
    """
    for other in others:
        if other.id == name:
            return other
    part = name.replace("\\", "/").rpartition("/")[2].removesuffix(".h5")
    matches = [tap for tap in taps if tap.id == part] or [tap for tap in taps if part and part in tap.id]
    if len(matches) == 1:
        return matches[0]
    if matches:
        examples = f"({matches[0].id}, {matches[1].id}, ...)"
        raise ValueError(f"{name!r} matches {len(matches)} tap tests {examples}. Give the whole name of the tap test.")
    raise ValueError(
        f"no tap test {name!r} in {path}. Run MachineFolder.contents {path} to list all {len(taps)} tap tests."
    )


def read_exclusion_reasons(entries: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """Read the reasons of all exclusions, by identity."""
    reasons: dict[str, str] = {}
    for line in entries:
        if line["kind"] == "exclude":
            reasons[line["tap"]] = line["reason"]
        elif line["kind"] == "include":
            reasons.pop(line["tap"], None)
    return reasons


def make_hit_entries(tap_id: str, decisions: Iterable[HitDecision]) -> list[JournalEntry]:
    """Make the journal entries of decisions on the hits of a tap test."""
    return [make_entry(HIT_LINE_KIND, tap=tap_id, **asdict(decision)) for decision in decisions]


def read_hit_decisions(entries: Sequence[Mapping[str, Any]]) -> dict[str, tuple[HitDecision, ...]]:
    """Read the decisions on hits that count, by tap test; it may still be in progress."""
    decisions: dict[str, list[HitDecision]] = {}
    for line in (line for line in entries if line["kind"] == HIT_LINE_KIND):
        decisions.setdefault(line["tap"], []).append(msgspec.convert(line, HitDecision))
    return {tap_id: merge_decisions(made) for tap_id, made in decisions.items()}


def read_committed_cuts(reading: JournalReading) -> tuple[CutEntry, ...]:
    """Read the test cuts of the journal, oldest first."""
    excluded = read_exclusion_reasons(reading.other_entries)
    lines = {line["id"]: line for line in reading.other_entries if line["kind"] == CUT_LINE_KIND}
    cuts = [parse_cut_line(line, excluded.get(name, "")) for name, line in lines.items()]
    return tuple(sorted(cuts, key=attrgetter("at")))


def read_committed_taps(reading: JournalReading) -> dict[str, TapEntry]:
    """Read the tap tests of the journal by identity."""
    accepted, lines = dict[str, tuple[str, ...]](), reading.other_entries
    for line in lines:
        if line["kind"] == "accept":
            accepted[line["tap"]] = (*accepted.get(line["tap"], ()), line["code"])
    excluded = read_exclusion_reasons(lines)
    by_hand = {line["tap"]: msgspec.convert(line, ModeEdits) for line in lines if line["kind"] == "modes"}
    hits = read_hit_decisions(lines)
    old = (TapEntry.from_line(line) for line in lines if line["kind"] == "tap")
    entries = {entry.id: entry for entry in (*decode_tap_entries(reading.tap_lines), *old)}
    for name in entries.keys() & (accepted.keys() | excluded.keys() | by_hand.keys() | hits.keys()):
        later = accepted.get(name, ()), excluded.get(name, ""), by_hand.get(name, NO_MODE_EDITS), hits.get(name, ())
        changes = dict(zip(FIELDS_OF_OTHER_LINES, later, strict=True))
        entries[name] = msgspec.structs.replace(entries[name], **changes)
    return entries


def read_mass_checks(entries: Sequence[Mapping[str, Any]]) -> tuple[MassCheckEntry, ...]:
    """Read the checks with a known mass, oldest first."""
    excluded = read_exclusion_reasons(entries)
    lines = [line for line in entries if line["kind"] == MASS_CHECK_KIND]
    checks = [msgspec.convert({**line, "excluded": excluded.get(line["id"], "")}, MassCheckEntry) for line in lines]
    return tuple(sorted(checks, key=attrgetter("date")))


def read_given_up_ids(reading: JournalReading) -> set[str]:
    """Return the identities of lost tap tests and recordings."""
    return {line["tap"] for line in reading.other_entries if line["kind"] == "lost" and "tap" in line}
