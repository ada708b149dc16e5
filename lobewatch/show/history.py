"""Show the history of a machine: tap tests, events and test cuts, as table, CSV and JSON."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields
from datetime import UTC, datetime
from typing import Any

from rich.cells import cell_len, set_cell_size

from acquisition import Conditions, Remark
from dsm import format_rounded
from lobewatch.history import HistoryRow
from lobewatch.logbook import Logbook
from lobewatch.machine import TapEntry
from lobewatch.machine.folder_updates import find_contradicting_cuts
from lobewatch.machine.journal.alarm_entries import Acknowledgement
from lobewatch.machine.journal.cut_entry import CutEntry
from lobewatch.machine.journal.entries import MaintenanceEvent
from lobewatch.show.programs.materials import power_json, power_text
from lobewatch.show.terminal.output import format_csv


def test_cut_text(cut: CutEntry) -> str:
    """A test cut in one line."""
    return f"{cut.id}: {cut.at.astimezone():%Y-%m-%d %H:%M} {cut_summary_text(cut)}"


def cut_summary_text(cut: CutEntry) -> str:
    """Name, speed and depth of a test cut, what it sounded like, and its power."""
    named = cut.program or "reference cut"
    words = f"{named} at {cut.speed_rpm:.6g} rpm, {1e3 * cut.depth:.4g} mm: {cut_result_text(cut)}, by {cut.by}"
    return words if cut.power is None else f"{words}; {power_text(cut.power, cut.cut)}"


def cut_result_text(cut: CutEntry) -> str:
    """Sound of a test cut, in words."""
    heard: str = cut.word
    if cut.chatter_frequency_hz is not None:
        error = cut.chatter_frequency_std_hz
        heard += f" at {cut.chatter_frequency_hz:.5g}{'' if error is None else f' +- {2 * error:.2g}'} Hz"
    return heard + (f" ({cut.reason})" if cut.reason else "")


def test_cut_json(cut: CutEntry) -> dict[str, Any]:
    """One test cut."""
    return {
        "id": cut.id,
        "time": cut.at.astimezone(UTC).isoformat(timespec="microseconds"),
        "program": cut.program,
        "tool": cut.tool,
        "feed": cut.feed,
        "speed_rpm": cut.speed_rpm,
        "commanded_rpm": cut.commanded_rpm,
        "depth_mm": 1e3 * cut.depth,
        "word": cut.word,
        "chatter_frequency_hz": cut.chatter_frequency_hz,
        "chatter_frequency_hz_std": cut.chatter_frequency_std_hz,
        "by": cut.by,
        **power_json(cut.power),
        "reason": cut.reason,
        "recording": None if cut.recording is None else cut.recording.file,
        "excluded": cut.excluded,
    }


def saved_cut_remarks(logbook: Logbook, cut: CutEntry, earlier: Sequence[CutEntry]) -> list[Remark]:
    """What is to be said of a cut that was heard and kept; earlier: those kept before."""
    contrary = find_contradicting_cuts(cut, earlier) if cut.is_usable else ()
    return [*untapped_remarks(logbook, cut), *map(contradiction_remark, contrary)]


def untapped_remarks(logbook: Logbook, cut: CutEntry) -> list[Remark]:
    """A remark that the tool was never tapped; none where it was."""
    if any(tap.tool == cut.tool for tap in logbook.taps):
        return []
    text = "was never tapped: the cut is kept, and counts when it is"
    return [Remark("tool-not-tapped", cut.tool, text, f"tap it with: lobewatch tap {logbook.folder.path}")]


def contradiction_remark(cut: CutEntry) -> Remark:
    """A remark that a cut was heard otherwise before."""
    text = f"heard otherwise at the same point ({cut_summary_text(cut)}); both are kept"
    cure = f"lobewatch exclude MACHINE {cut.id} --reason TEXT takes out the one that is wrong"
    return Remark("cuts-contradict", cut.id, text, cure)


ROW_FIELDS = {"frequency_hz": "frequency", "damping_ratio": "damping_ratio", "stiffness_n_per_m": "stiffness"}
"""Field of a row by its name in CSV and JSON."""
HISTORY_HEADINGS = (
    ("time", "what", "tool", "in", "frequency", "damping", "stiffness", "name"),
    ("", "", "", "", "(Hz)", "(%)", "(N/um)", ""),
)
NUMBER_COLUMNS = 4, 5, 6
"""Columns of numbers."""
MIN_SHORT_NAME = 6
"""Characters of the shortest name of a tap test, an end of its identity: "x_ecbf"."""
CONDITION_NAMES = tuple(field.name for field in fields(Conditions))
HISTORY_COLUMNS = ("time", "kind", "id", "tool", "direction")
CONDITION_FORMATS = {
    "temperature_c": "{:g} °C",
    "stick_out_mm": "stick-out {:g} mm",
    "drawbar_kn": "drawbar {:g} kN",
    "hours": "{:g} h",
    "state": "state {}",
    "reclamped": "clamped anew",
    "note": "note: {}",
}
"""Words for a condition of a tap test, by its name."""


def event_text(event: MaintenanceEvent) -> str:
    """For people."""
    baseline = " (new baseline)" if event.new_baseline else ""
    return f"{event.id}: {event.time.astimezone():%Y-%m-%d %H:%M} {event.text}{baseline}"


def event_json(event: MaintenanceEvent) -> dict[str, Any]:
    """One event."""
    named = {"id": event.id, "time": _utc_text(event.time), "text": event.text}
    return {**named, "new_baseline": event.new_baseline}


def acknowledgement_json(word: Acknowledgement) -> dict[str, Any]:
    """One acknowledgement."""
    until = word.until and _utc_text(word.until)
    return {
        "id": word.alarm_id,
        "time": _utc_text(word.time),
        "operator": word.operator,
        "until": until,
        "note": word.note,
    }


def history_json(logbook: Logbook) -> dict[str, Any]:
    """The whole history; an excluded tap test has no values, those of one that is kept count for nothing."""
    return {
        "machine": logbook.machine.machine.name,
        "taps": [_tap_json(row, logbook) for row in logbook.history.rows],
        "kept": [_tap_json(row, logbook) for row in logbook.history.kept],
        "excluded": [_excluded_json(tap) for tap in logbook.files.excluded],
        "events": [event_json(event) for event in logbook.files.events],
        "acknowledged": [acknowledgement_json(word) for word in logbook.files.acknowledgements],
        "cuts": [test_cut_json(cut) | {"text": cut_summary_text(cut)} for cut in logbook.files.cuts],
    }


def history_csv(logbook: Logbook) -> str:
    """A line for each tap test, cut, event and acknowledgement, excluded or not, oldest first; headings on top."""
    names = [program.name for program in logbook.machine.program]
    values = [heading for name in ROW_FIELDS for heading in (name, f"{name}_std")]
    verdicts = {name: f"verdict: {name}" for name in names}
    heads = [*HISTORY_COLUMNS, *values, *CONDITION_NAMES, "questions", *verdicts.values(), "reason", "text"]
    rows: list[list[Any]] = [heads]
    for line in _history_entries(logbook):
        cells = {key: value for key, value in line.items() if key in heads} | line.get("conditions", {})
        cells |= {verdicts[name]: word for name, word in line.get("verdicts", {}).items()}
        cells["questions"] = " ".join(line.get("questions", ()))
        rows.append([_csv_value(cells.get(head)) for head in heads])
    return format_csv(rows)


def history_lines(logbook: Logbook) -> list[str]:
    """For people, in local time: a line for each tap test and event below the headings, what is said of it below it."""
    lines = _history_entries(logbook)
    taps = [line["id"] for line in lines if "direction" in line]
    names = dict(zip(taps, shorten_ids(taps), strict=True))
    rows = [
        *HISTORY_HEADINGS,
        *((*_history_cells(line), names.get(line["id"], line.get("name", ""))) for line in lines),
    ]
    widths = [max(map(cell_len, column)) for column in zip(*rows, strict=True)]
    shown = ["  ".join(_align_cells(row, widths)).rstrip() for row in rows]
    texts = ["", "", *map(_note_text, lines)]
    return [part for row, text in zip(shown, texts, strict=True) for part in (row, f"  {text}") if part.strip()]


def shorten_ids(ids: Sequence[str]) -> list[str]:
    """The shortest end of each identity that no other contains, of six characters at least.

    Commands take it in place of the identity.
    """
    names, size = dict(zip(ids, ids, strict=True)), MIN_SHORT_NAME
    left = [name for name in names if len(name) > size]
    while left:
        ends = {name[-size:] for name in left}
        parts = Counter(
            part for name in ids for i in range(len(name) - size + 1) if (part := name[i : i + size]) in ends
        )
        names |= {name: name[-size:] for name in left if parts[name[-size:]] == 1}
        size += 1
        left = [name for name in left if names[name] == name and len(name) > size]
    return [names[name] for name in ids]


def _align_cells(row: Sequence[str], widths: Sequence[int]) -> Iterator[str]:
    """Cells as wide as their columns, numbers to the right."""
    for place, (cell, width) in enumerate(zip(row, widths, strict=True)):
        yield " " * (width - cell_len(cell)) + cell if place in NUMBER_COLUMNS else set_cell_size(cell, width)


def _history_cells(line: Mapping[str, Any]) -> list[str]:
    when = f"{datetime.fromisoformat(line['time']).astimezone():%Y-%m-%d %H:%M}"
    numbers = [_value_text(line, name, scale) for name, scale in zip(ROW_FIELDS, (1.0, 0.01, 1e6), strict=True)]
    return [when, line["kind"].removeprefix("new "), line.get("tool", ""), line.get("direction", ""), *numbers]


def _history_entries(logbook: Logbook) -> list[dict[str, Any]]:
    """Tap tests, excluded ones, events, acknowledgements and test cuts, oldest first."""
    history = history_json(logbook)
    events = [
        event | {"kind": "new baseline" if event["new_baseline"] else "event", "name": event["id"]}
        for event in history["events"]
    ]
    excluded = [tap | {"kind": "excluded"} for tap in history["excluded"]]
    taps = [tap | {"kind": kind} for kind, name in (("tap", "taps"), ("kept", "kept")) for tap in history[name]]
    cuts = [_cut_entry(cut) for cut in history["cuts"]]
    words = [
        {"kind": "ack", "id": word.alarm_id, "time": _utc_text(word.time), "text": f"{word.alarm_id}: {word}"}
        for word in logbook.files.acknowledgements
    ]
    return sorted([*events, *excluded, *taps, *cuts, *words], key=lambda line: line["time"])


def _cut_entry(cut: Mapping[str, Any]) -> dict[str, Any]:
    """A test cut as the table shows it."""
    kind = "excluded" if cut["excluded"] else "cut"
    shown = {name: cut[name] for name in ("id", "time", "tool", "text")}
    return {**shown, "kind": kind, "name": cut["id"], "reason": cut["excluded"], "conditions": {}}


def _tap_json(row: HistoryRow, logbook: Logbook) -> dict[str, Any]:
    entry: dict[str, Any] = {
        "id": row.tap_id,
        "time": _utc_text(row.time),
        "tool": row.tool,
        "direction": row.direction,
    }
    for name, field in ROW_FIELDS.items():
        entry[name], entry[f"{name}_std"] = getattr(row, field)
    entry["baseline"] = None if row.baseline is None else _utc_text(row.baseline)
    entry["series"], entry["conditions"] = row.series, row.conditions.specified
    entry["software"] = row.software or logbook.history.software
    entry["questions"] = [question.code for question in row.questions]
    words = row.verdicts or {}
    entry["verdicts"] = {p.name: words[p.name].stability.value for p in logbook.machine.program if p.name in words}
    return entry


def _excluded_json(tap: TapEntry) -> dict[str, Any]:
    time = _utc_text(datetime.fromisoformat(tap.time))
    named = {"id": tap.id, "time": time, "tool": tap.tool, "direction": tap.direction}
    return {**named, "conditions": tap.conditions.specified, "reason": tap.excluded}


def _utc_text(time: datetime) -> str:
    """A time as text, all alike, so that they sort."""
    return time.astimezone(UTC).isoformat(timespec="microseconds")


def _csv_value(value: Any) -> Any:
    return "" if isinstance(value, float) and not math.isfinite(value) else value


def _value_text(line: Mapping[str, Any], name: str, scale: float) -> str:
    value = line.get(name, math.nan)
    return format_rounded(value, line[f"{name}_std"], scale) if math.isfinite(value) else ""


def _note_text(line: Mapping[str, Any]) -> str:
    """Its text or reason, conditions, what is asked, and the verdicts of then."""
    if "text" in line:
        return f"{line['text']}{'; ' + line['reason'] if line.get('reason') else ''}"
    under = condition_texts(Conditions.from_mapping(line["conditions"]))
    if line["kind"] == "excluded":
        return "; ".join([line["reason"], *under])
    words = [f"{name}: {word}" for name, word in line["verdicts"].items()]
    return "; ".join([*under, *(f"question {code}" for code in line["questions"]), *words])


def condition_texts(conditions: Conditions) -> list[str]:
    """Conditions of a tap test that are known, a few words each."""
    return [
        words.format(conditions.specified[name])
        for name, words in CONDITION_FORMATS.items()
        if name in conditions.specified
    ]
