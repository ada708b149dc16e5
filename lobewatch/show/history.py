"""Show the history of a machine: tap tests, events and test cuts, as table, CSV and JSON."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from datetime import UTC, datetime
from typing import Any

import msgspec

from acquisition import Conditions, Remark
from dsm import format_rounded
from lobewatch.cuts.learning.power_readings import find_reading_remarks
from lobewatch.cuts.learning.verdict_by_sound import make_contradiction_remark
from lobewatch.history import HistoryRow
from lobewatch.logbook import Logbook
from lobewatch.machine.folder_updates import find_contradicting_cuts
from lobewatch.machine.journal.alarm_entries import Acknowledgement
from lobewatch.machine.journal.entries import POWER_READING, CutEntry
from lobewatch.machine.journal.mass_checks import MassCheckEntry
from lobewatch.machine.journal.read_entries import MaintenanceEvent
from lobewatch.machine.journal.tap_entry import TapEntry
from lobewatch.machine.settings.display_units import LENGTH
from lobewatch.measurement.hit_choice import format_decisions
from lobewatch.show.programs.materials import power_json, power_text
from lobewatch.show.programs.part_texts import parts_texts
from lobewatch.show.terminal.output import JsonObject, align_columns, blank_nonfinite, format_csv, pick
from lobewatch.show.terminal.sentences import wrap_lines


def cut_text(cut: CutEntry) -> str:
    """Return a test cut with its name and time, in one line."""
    return f"{cut.id}: {cut.at.astimezone():%Y-%m-%d %H:%M} {cut_summary_text(cut)}"


def cut_summary_text(cut: CutEntry) -> str:
    """Return name, speed and depth of a test cut, its result, and its power."""
    named = cut.program or "reference cut"
    depth = LENGTH.text(1e3 * cut.depth, ".4g")
    words = f"{named} at {cut.speed_rpm:.6g} rpm, {depth}: {cut_result_text(cut)}, by {cut.by}"
    return words if cut.power is None else f"{words}, {power_text(cut.power, cut.cut)}"


def cut_result_text(cut: CutEntry) -> str:
    """Return the result of a test cut in words."""
    if cut.reason == POWER_READING:
        return "power reading"
    heard: str = cut.word
    if cut.chatter_frequency_hz is not None:
        error = cut.chatter_frequency_std_hz
        heard += f" at {cut.chatter_frequency_hz:.5g}{'' if error is None else f' +- {2 * error:.2g}'} Hz"
    parts = "".join(f", {text}" for text in parts_texts(cut.parts))
    return heard + (f" ({cut.reason})" if cut.reason else "") + parts


def mass_check_result_text(check: MassCheckEntry) -> str:
    """Return the result of a mass check in words."""
    if check.mass_kg is None:
        return "emulated device"
    result = "passed" if check.passed else "failed"
    return f"{result}, ratio {check.ratio:.3f} on {check.mass_kg:g} kg"


def _utc_text(time: datetime | str) -> str:
    """Return a time as text of one form, which sorts by time."""
    moment = datetime.fromisoformat(time) if isinstance(time, str) else time
    return moment.astimezone(UTC).isoformat(timespec="microseconds")


def cut_json(cut: CutEntry) -> JsonObject:
    """Return one test cut as a JSON object."""
    return {
        "id": cut.id,
        "time": _utc_text(cut.at),
        **pick(cut, "program", "tool", "feed", "speed_rpm", "commanded_rpm"),
        "depth_mm": cut.depth * 1e3,
        "word": cut.word,
        "chatter_frequency_hz": cut.chatter_frequency_hz,
        "chatter_frequency_hz_std": cut.chatter_frequency_std_hz,
        "by": cut.by,
        **power_json(cut.power),
        "reason": cut.reason,
        "parts": [asdict(part) for part in cut.parts],
        "recording": cut.recording and cut.recording.file,
        "excluded": cut.excluded,
    }


def event_json(event: MaintenanceEvent) -> JsonObject:
    """Return one event as a JSON object."""
    return {**vars(event), "time": _utc_text(event.time)}


def _acknowledgement_json(ack: Acknowledgement) -> JsonObject:
    until = ack.until and _utc_text(ack.until)
    return {"id": ack.alarm_id, "time": _utc_text(ack.time), "operator": ack.operator, "until": until, "note": ack.note}


def saved_cut_remarks(logbook: Logbook, cut: CutEntry, earlier: Sequence[CutEntry]) -> list[Remark]:
    """Return the remarks on a cut that was saved; earlier: cuts saved before."""
    contrary = find_contradicting_cuts(cut, earlier) if cut.is_usable else ()
    asked = find_reading_remarks(cut, logbook.machine, earlier)
    return [*untapped_remarks(logbook, cut), *map(contradiction_remark, contrary), *asked]


def untapped_remarks(logbook: Logbook, cut: CutEntry) -> list[Remark]:
    """Return a remark that the tool was never tapped; none where it was."""
    if any(tap.tool == cut.tool for tap in logbook.taps):
        return []
    text = "no tap test of this tool yet, so only its test cuts count"
    return [Remark("tool-not-tapped", cut.tool, text, f"Tap the tool with lobewatch tap {logbook.folder.path}")]


def contradiction_remark(cut: CutEntry) -> Remark:
    """Return a remark on an earlier cut with another result at the same point."""
    cure = f"Exclude the wrong test cut, for example with lobewatch exclude MACHINE {cut.id} --reason TEXT"
    return make_contradiction_remark(cut.id, cut_summary_text(cut), cure)


VALUE_SCALES = {"frequency_hz": 1.0, "damping_ratio": 0.01, "stiffness_n_per_m": 1e6}
"""Size of the unit shown for each JSON key and CSV column of a value."""
HISTORY_HEADINGS = (
    ("time", "entry", "tool", "axis", "frequency", "damping", "stiffness", "name"),
    ("", "", "", "", "(Hz)", "(%)", "(N/um)", ""),
)
MIN_SHORT_NAME = 6
"""Length of the shortest name of a tap test, the end of its identity, such as "x_ecbf" (characters)."""
CONDITION_FORMATS = {
    "temperature_c": "{:g} °C",
    "stick_out_mm": "stick-out {}",
    "drawbar_kn": "drawbar {:g} kN",
    "hours": "{:g} h running time",
    "state": "state {}",
    "reclamped": "reclamped",
    "note": "note: {}",
}
"""Words for each condition of a tap test."""


def event_text(event: MaintenanceEvent) -> str:
    """Return an event in one line."""
    baseline = " (new baseline)" if event.new_baseline else ""
    return f"{event.id}: {event.time.astimezone():%Y-%m-%d %H:%M} {event.text}{baseline}"


def history_json(logbook: Logbook) -> JsonObject:
    """Return the whole history; excluded tap tests have no values, and those of kept ones do not count."""
    return {
        "machine": logbook.machine.machine.name,
        "taps": [_tap_json(row, logbook) for row in logbook.checked_history.rows],
        "kept": [_tap_json(row, logbook) for row in logbook.history.kept],
        "excluded": list(map(_excluded_json, logbook.files.excluded)),
        "events": list(map(event_json, logbook.files.contents.events)),
        "acknowledged": list(map(_acknowledgement_json, logbook.files.contents.acknowledgements)),
        "mass_checks": msgspec.to_builtins(logbook.files.contents.mass_checks),
        "cuts": [cut_json(cut) | {"text": cut_summary_text(cut)} for cut in logbook.files.contents.cuts],
    }


def history_csv(logbook: Logbook) -> str:
    """Return a CSV line for each tap test, cut, event and acknowledgement, oldest first, below the headings."""
    values = [heading for name in VALUE_SCALES for heading in (name, f"{name}_std")]
    verdicts = {program.name: f"verdict: {program.name}" for program in logbook.machine.program}
    values += (field.name for field in fields(Conditions))
    headings = ["time", "kind", "id", "tool", "direction", *values, "questions", *verdicts.values(), "reason", "text"]
    rows: list[list[Any]] = [headings]
    for entry in _history_entries(logbook):
        cells = {key: value for key, value in entry.items() if key in headings} | entry.get("conditions", {})
        cells |= {verdicts[name]: word for name, word in entry.get("verdicts", {}).items()}
        cells["questions"] = " ".join(entry.get("questions", ()))
        rows.append([blank_nonfinite(cells.get(heading)) for heading in headings])
    return format_csv(rows)


def history_lines(logbook: Logbook) -> list[str]:
    """Return the history in local time: a line for each entry below the headings, its notes in a line below it."""
    entries = _history_entries(logbook)
    taps = [entry["id"] for entry in entries if "direction" in entry]
    names: dict[str, str] = {entry["id"]: entry.get("name", "") for entry in entries}
    names |= zip(taps, shorten_ids(taps), strict=True)
    cells = ([*_history_cells(entry), names[entry["id"]]] for entry in entries)
    lines = align_columns([*HISTORY_HEADINGS, *cells], numbers=(4, 5, 6))
    texts = ["", "", *map(_note_text, entries)]
    parts = (part for line, text in zip(lines, texts, strict=True) for part in (line, *wrap_lines([text])))
    return [part for part in parts if part.strip()]


def shorten_ids(ids: Sequence[str]) -> list[str]:
    """Return the shortest end of each identity that no other identity contains, at least six characters.

    Commands accept it instead of the identity.
    """
    names, n = dict(zip(ids, ids, strict=True)), MIN_SHORT_NAME
    left = [name for name in names if len(name) > n]
    while left:
        ends = {name[-n:] for name in left}
        parts = Counter(part for name in ids for i in range(len(name) - n + 1) if (part := name[i : i + n]) in ends)
        names |= {name: name[-n:] for name in left if parts[name[-n:]] == 1}
        n += 1
        left = [name for name in left if names[name] == name and len(name) > n]
    return [names[name] for name in ids]


def _history_cells(line: Mapping[str, Any]) -> list[str]:
    when = f"{datetime.fromisoformat(line['time']).astimezone():%Y-%m-%d %H:%M}"
    values = ((line.get(name, math.nan), line.get(f"{name}_std"), scale) for name, scale in VALUE_SCALES.items())
    numbers = [format_rounded(*value) if math.isfinite(value[0]) else "" for value in values]
    return [when, line["kind"].removeprefix("new "), line.get("tool", ""), line.get("direction", ""), *numbers]


def _history_entries(logbook: Logbook) -> list[JsonObject]:
    """Return tap tests, excluded ones, events, acknowledgements, cuts and mass checks as JSON objects, oldest first."""
    history = history_json(logbook)
    groups = ("tap", history["taps"]), ("kept", history["kept"]), ("excluded", history["excluded"])
    entries = [{**tap, "kind": kind} for kind, taps in groups for tap in taps]
    for event in history["events"]:
        kind = "new baseline" if event["new_baseline"] else "event"
        entries.append({**event, "kind": kind, "name": event["id"]})
    for cut in history["cuts"]:
        shown = {"kind": "excluded" if cut["excluded"] else "cut", "reason": cut["excluded"], "conditions": {}}
        entries.append(shown | {"name": cut["id"], **{name: cut[name] for name in ("id", "time", "tool", "text")}})
    for check in logbook.files.contents.mass_checks:
        shown = {"kind": "excluded" if check.excluded else "check", "reason": check.excluded, "conditions": {}}
        named = {"id": check.id, "name": check.id, "time": _utc_text(check.date)}
        entries.append(shown | named | {"text": f"{check.id}: {mass_check_result_text(check)}"})
    for ack in logbook.files.contents.acknowledgements:
        told = {"kind": "ack", "id": ack.alarm_id, "time": _utc_text(ack.time)}
        entries.append(told | {"text": f"{ack.alarm_id}: {ack}"})
    return sorted(entries, key=lambda entry: entry["time"])


def _tap_json(row: HistoryRow, logbook: Logbook) -> JsonObject:
    verdicts = row.verdicts or {}
    names = [program.name for program in logbook.machine.program if program.name in verdicts]
    entry = logbook.files.by_id.get(row.tap_id)
    return {
        "id": row.tap_id,
        "time": _utc_text(row.time),
        "tool": row.tool,
        "direction": row.direction,
        "frequency_hz": row.frequency.value,
        "frequency_hz_std": row.frequency.std,
        "damping_ratio": row.damping_ratio.value,
        "damping_ratio_std": row.damping_ratio.std,
        "stiffness_n_per_m": row.stiffness.value,
        "stiffness_n_per_m_std": row.stiffness.std,
        "baseline": row.baseline and _utc_text(row.baseline),
        "series": row.series,
        "conditions": row.conditions.specified,
        "software": row.software or logbook.history.software,
        "hit_decisions": entry.hit_decisions if entry else (),
        "questions": [question.code for question in row.questions],
        "verdicts": {name: verdicts[name].stability.value for name in names},
    }


def _excluded_json(tap: TapEntry) -> JsonObject:
    named = {"id": tap.id, "time": _utc_text(tap.time), "tool": tap.tool, "direction": tap.direction}
    return named | {"conditions": tap.conditions.specified, "reason": tap.excluded}


def _note_text(line: Mapping[str, Any]) -> str:
    """Return text or reason of an entry, or conditions, questions and verdicts of a tap test."""
    if "text" in line:
        return ", ".join(filter(None, (line["text"], line.get("reason"))))
    under = condition_texts(Conditions.from_mapping(line["conditions"]))
    if line["kind"] == "excluded":
        return ", ".join([line["reason"], *under])
    words = [f"{name}: {word}" for name, word in line["verdicts"].items()]
    under += [f"hits by hand: {format_decisions(line['hit_decisions'])}"] if line["hit_decisions"] else []
    return ", ".join([*under, *(f"question {code}" for code in line["questions"]), *words])


def condition_texts(conditions: Conditions) -> list[str]:
    """Return a few words for each specified condition of a tap test."""
    given = conditions.specified
    if "stick_out_mm" in given:
        given["stick_out_mm"] = LENGTH.text(given["stick_out_mm"])
    return [words.format(given[name]) for name, words in CONDITION_FORMATS.items() if name in given]
