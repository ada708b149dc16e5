"""Join the lines of a journal that another computer wrote: each fact counts once, and identities stay unique.

The lines of this journal stay as they are. New lines of the other one are appended with the mark of the line they come
from, so that a later join finds them again.
"""

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from itertools import count
from typing import Any, NamedTuple

import msgspec

from lobewatch.machine.journal.alarm_entries import format_alarm_id
from lobewatch.machine.journal.journal import make_entry
from lobewatch.machine.journal.line_formats import (
    JOIN_LINE_KIND,
    JOINED_KEY,
    ConflictingEntries,
    JoinEntry,
    LineFrame,
)

Entry = Mapping[str, Any]
"""Line of a journal as a JSON object."""
FRAME_KEYS = {*LineFrame.__struct_fields__} - {"kind", "time"}
"""Keys that say where a line is, not its fact."""
IDENTITY_PREFIXES = {"event": "e", "cut": "c", "mass-check": "m"}
"""First letters of identities, by kind of line."""
REFERENCE_KEYS = ("id", "tap", "withdraws", "raised_by")
"""Keys of identities."""
UNREPEATED_KINDS = ("accept", "lost")
"""Kinds without an identity whose fact is entered once if both computers entered it."""


class JoinedLines(NamedTuple):
    """Lines to append, and the changes in them."""

    entries: list[dict[str, Any]]
    """Lines to append, oldest first, the line of the join last; empty if nothing is new."""
    n_new: int
    """Number of facts that were new."""
    renumbered: dict[str, str]
    """New identities by those in the other journal."""


def compute_fact_mark(entry: Entry) -> str:
    """Return the mark of a line by its fact, wherever the line is, and of the original line if it was joined.

    Parameters
    ----------
    entry
        Line of a journal.
    """
    if entry.get(JOINED_KEY):
        return str(entry[JOINED_KEY])
    fact = {key: value for key, value in entry.items() if key not in FRAME_KEYS}
    return hashlib.sha256(json.dumps(fact, sort_keys=True).encode()).hexdigest()


def next_identity(kind: str, entries: Iterable[Entry], more: Iterable[str] = ()) -> str:
    """Return the first identity after all of its kind, such as "e3".

    Parameters
    ----------
    kind
        Kind of line, a key of `IDENTITY_PREFIXES`.
    entries
        Lines of the journal.
    more
        Further identities in use.
    """
    used = [str(entry["id"]) for entry in entries if entry["kind"] == kind and "id" in entry]
    numbers = [int(name[1:]) for name in (*used, *more) if name[1:].isdigit()]
    return f"{IDENTITY_PREFIXES[kind]}{max(numbers, default=0) + 1}"


def join_lines(own: Sequence[Entry], other: Sequence[Entry], file: str) -> JoinedLines:
    """Join the lines of another journal of the same machine.

    Of two entries on the same subject that contradict each other, the newer one counts.

    Parameters
    ----------
    own
        Lines of this journal.
    other
        Lines of the other journal.
    file
        Its name.
    """
    known, others = _by_mark(own), _by_mark(other)
    mine = [entry for entry in own if compute_fact_mark(entry) not in others]
    new = {mark: entry for mark, entry in others.items() if mark not in known}
    same, renumbered = _match_identities(own, mine, new)
    shared = known.keys() & others.keys()
    names = {str(others[mark]["id"]): str(known[mark]["id"]) for mark in shared if "id" in known[mark]}
    names |= same | renumbered
    lines = {mark: known.get(mark) or _with_names(entry, names) for mark, entry in others.items()}
    repeated = {_fact_of(entry) for entry in mine if entry["kind"] in UNREPEATED_KINDS}
    new = {mark: lines[mark] for mark, entry in new.items() if str(entry.get("id")) not in same}
    new = {mark: entry for mark, entry in new.items() if _fact_of(entry) not in repeated}
    contradictions, restated = _resolve_subjects(own, lines, new)
    joined = [{**entry, JOINED_KEY: mark} for mark, entry in (*new.items(), *restated.items())]
    if joined:
        about = JoinEntry(file, len(new), renumbered, tuple(contradictions))
        joined.append(make_entry(JOIN_LINE_KIND, **msgspec.to_builtins(about)))
    return JoinedLines(joined, len(new), renumbered)


def _by_mark(entries: Sequence[Entry]) -> dict[str, Entry]:
    """Return entries by mark, a repeated one at its last place."""
    return dict(reversed({compute_fact_mark(entry): entry for entry in reversed(entries)}.items()))


def _match_identities(
    own: Sequence[Entry], mine: Sequence[Entry], new: Mapping[str, Entry]
) -> tuple[dict[str, str], dict[str, str]]:
    """Return the identities here of facts that both computers entered, and new ones for identities given twice."""
    withdrawn = {str(entry["withdraws"]) for entry in (*mine, *new.values()) if "withdraws" in entry}
    twins = {_fact_of(entry): str(entry["id"]) for entry in mine if entry.get("id") not in {None, *withdrawn}}
    taken = {str(entry["id"]): entry for entry in own if "id" in entry}
    given = [str(entry["id"]) for entry in new.values() if "id" in entry]
    names, renumbered = dict[str, str](), dict[str, str]()
    for entry in new.values():
        name = str(entry.get("id", ""))
        if name not in {"", *withdrawn} and _fact_of(entry) in twins:
            names[name] = twins[_fact_of(entry)]
        elif name in taken and (entry["kind"] != "tap" or entry["sha256"] != taken[name].get("sha256")):
            renumbered[name] = _new_identity(entry, own, [*taken, *given, *renumbered.values()])
    return names, renumbered


def _new_identity(entry: Entry, own: Sequence[Entry], used: Sequence[str]) -> str:
    kind = str(entry["kind"])
    if kind in IDENTITY_PREFIXES:
        return next_identity(kind, own, [name for name in used if name[:1] == IDENTITY_PREFIXES[kind]])
    return next(name for number in count(2) if (name := f"{entry['id']}-{number}") not in used)


def _with_names(entry: Entry, names: Mapping[str, str]) -> dict[str, Any]:
    """Return an entry with other identities, and without the keys that say where the line is."""
    changed: dict[str, Any] = {key: names[entry[key]] for key in REFERENCE_KEYS if entry.get(key) in names}
    recording = entry.get("recording")
    if isinstance(recording, dict) and recording.get("id") in names:
        changed["recording"] = {**recording, "id": names[recording["id"]]}
    return {key: value for key, value in entry.items() if key not in FRAME_KEYS} | changed


def _fact_of(entry: Entry) -> str:
    """Return the fact of a line without its time, and without the identity that its computer gave it."""
    left_out = {*FRAME_KEYS, "time", *(["id"] if str(entry["kind"]) in IDENTITY_PREFIXES else [])}
    return json.dumps({key: value for key, value in entry.items() if key not in left_out}, sort_keys=True)


def find_subject(entry: Entry) -> str:
    """Return the subject of a line whose newest line alone counts; empty for all other kinds.

    Parameters
    ----------
    entry
        Line of a journal.
    """
    kind = "exclude" if entry["kind"] == "include" else str(entry["kind"])
    keys = {"exclude": ("tap",), "modes": ("tap",), "hit": ("tap", "hit"), "ack": ("code", "about", "raised_by")}
    return json.dumps([kind, *(entry.get(key) for key in keys[kind])]) if kind in keys else ""


def _resolve_subjects(
    own: Iterable[Entry], lines: Mapping[str, Entry], new: Mapping[str, Entry]
) -> tuple[list[ConflictingEntries], dict[str, Entry]]:
    """Return contradictions, and the lines to append once more so that the counting line of each subject is last."""
    marked = [(compute_fact_mark(entry), entry) for entry in own]
    unknown_there = {find_subject(entry): (mark, entry) for mark, entry in marked if mark not in lines}
    last_other = {find_subject(entry): (mark, entry) for mark, entry in lines.items()}
    last_new = {find_subject(entry): mark for mark, entry in new.items()}
    contradictions, restated = list[ConflictingEntries](), dict[str, Entry]()
    last_new.pop("", None)
    for subject, newest in last_new.items():
        kept, dropped = last_other[subject], unknown_there.get(subject)
        if dropped is not None:
            kept, dropped = sorted((kept, dropped), key=_time_of, reverse=True)
            if _fact_of(kept[1]) != _fact_of(dropped[1]):
                both = (_with_names(entry, {}) for _, entry in (kept, dropped))
                contradictions.append(ConflictingEntries(name_subject(kept[1]), *both))
        if kept[0] != newest:
            restated[kept[0]] = _with_names(kept[1], {})
    return contradictions, restated


def _time_of(line: tuple[str, Entry]) -> tuple[str, str]:
    """Return the time of writing (UTC, ISO 8601), and the mark for lines of the same time."""
    return str(line[1].get("time")), line[0]


def name_subject(entry: Entry) -> str:
    """Return the identity of the tap test, test cut, mass check or alarm of a line.

    Parameters
    ----------
    entry
        Line with a subject.
    """
    return (
        format_alarm_id(entry["code"], entry["about"], entry["raised_by"]) if entry["kind"] == "ack" else entry["tap"]
    )


def find_open_contradictions(entries: Iterable[Entry]) -> list[ConflictingEntries]:
    """Return the contradictions of joined journals that no later entry on the same subject has answered.

    Parameters
    ----------
    entries
        Understood lines of a journal, oldest first.
    """
    found = dict[str, tuple[str, ConflictingEntries]]()
    for entry in entries:
        time = str(entry.get("time"))
        joined_until, _ = found.get(find_subject(entry), ("", None))
        if JOINED_KEY not in entry or time > joined_until:
            found.pop(find_subject(entry), None)
        if entry["kind"] == JOIN_LINE_KIND:
            for one in msgspec.convert(entry, JoinEntry).contradictions:
                found[find_subject(one.kept)] = max(time, *(str(side["time"]) for side in (one.kept, one.other))), one
    return [one for _, one in found.values()]
