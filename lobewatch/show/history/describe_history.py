"""The history of a machine line by line: tap tests, those that do not count, events, and test cuts."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields
from datetime import UTC, datetime
from typing import Any

from rich.cells import cell_len, set_cell_size

from acquisition import Conditions
from dsm import rounded
from lobewatch.history import Row
from lobewatch.logbook import Logbook
from lobewatch.machine import TapEntry
from lobewatch.machine.journal.acknowledgement import Acknowledgement
from lobewatch.machine.journal.event import MaintenanceEvent
from lobewatch.show.history.describe_cut import cut_json, cut_words
from lobewatch.show.terminal.csv_text import csv_text

VALUES = {"frequency_hz": "frequency", "damping_ratio": "damping_ratio", "stiffness_n_per_m": "stiffness"}
"""Field of a row by its name in CSV and JSON."""
HEADINGS = (
    ("time", "what", "tool", "in", "frequency", "damping", "stiffness", "name"),
    ("", "", "", "", "(Hz)", "(%)", "(N/um)", ""),
)
NUMBERS = 4, 5, 6
"""Columns of numbers."""
SHORTEST = 6
"""Characters of the shortest name of a tap test, an end of its identity: "x_ecbf"."""
UNDER = tuple(field.name for field in fields(Conditions))
COLUMNS = ("time", "kind", "id", "tool", "direction")
CONDITION_WORDS = {
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
    named = {"id": event.id, "time": _utc(event.time), "text": event.text}
    return {**named, "new_baseline": event.new_baseline}


def acknowledgement_json(word: Acknowledgement) -> dict[str, Any]:
    """One acknowledgement."""
    until = word.until and _utc(word.until)
    return {"id": word.alarm, "time": _utc(word.time), "operator": word.operator, "until": until, "note": word.note}


def history_json(logbook: Logbook) -> dict[str, Any]:
    """The whole history; an excluded tap test has no values, those of one that is kept count for nothing."""
    return {
        "machine": logbook.machine.machine.name,
        "taps": [_tap_json(row, logbook) for row in logbook.history.rows],
        "kept": [_tap_json(row, logbook) for row in logbook.history.kept],
        "excluded": [_excluded_json(tap) for tap in logbook.files.excluded],
        "events": [event_json(event) for event in logbook.files.events],
        "acknowledged": [acknowledgement_json(word) for word in logbook.files.acknowledgements],
        "cuts": [cut_json(cut) | {"text": cut_words(cut)} for cut in logbook.files.cuts],
    }


def history_csv(logbook: Logbook) -> str:
    """A line for each tap test, cut, event and acknowledgement, excluded or not, oldest first; headings on top."""
    names = [program.name for program in logbook.machine.program]
    values = [heading for name in VALUES for heading in (name, f"{name}_std")]
    verdicts = {name: f"verdict: {name}" for name in names}
    heads = [*COLUMNS, *values, *UNDER, "questions", *verdicts.values(), "reason", "text"]
    rows: list[list[Any]] = [heads]
    for line in _lines(logbook):
        cells = {key: value for key, value in line.items() if key in heads} | line.get("conditions", {})
        cells |= {verdicts[name]: word for name, word in line.get("verdicts", {}).items()}
        cells["questions"] = " ".join(line.get("questions", ()))
        rows.append([_cell(cells.get(head)) for head in heads])
    return csv_text(rows)


def history_lines(logbook: Logbook) -> list[str]:
    """For people, in local time: a line for each tap test and event below the headings, what is said of it below it."""
    lines = _lines(logbook)
    taps = [line["id"] for line in lines if "direction" in line]
    names = dict(zip(taps, short_names(taps), strict=True))
    rows = [*HEADINGS, *((*_cells(line), names.get(line["id"], line.get("name", ""))) for line in lines)]
    widths = [max(map(cell_len, column)) for column in zip(*rows, strict=True)]
    shown = ["  ".join(_placed(row, widths)).rstrip() for row in rows]
    texts = ["", "", *map(_said, lines)]
    return [part for row, text in zip(shown, texts, strict=True) for part in (row, f"  {text}") if part.strip()]


def short_names(ids: Sequence[str]) -> list[str]:
    """The shortest end of each identity that no other contains, of six characters at least.

    Commands take it in place of the identity.
    """
    names, size = dict(zip(ids, ids, strict=True)), SHORTEST
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


def _placed(row: Sequence[str], widths: Sequence[int]) -> Iterator[str]:
    """Cells as wide as their columns, numbers to the right."""
    for place, (cell, width) in enumerate(zip(row, widths, strict=True)):
        yield " " * (width - cell_len(cell)) + cell if place in NUMBERS else set_cell_size(cell, width)


def _cells(line: Mapping[str, Any]) -> list[str]:
    when = f"{datetime.fromisoformat(line['time']).astimezone():%Y-%m-%d %H:%M}"
    numbers = [_number(line, name, scale) for name, scale in zip(VALUES, (1.0, 0.01, 1e6), strict=True)]
    return [when, line["kind"].removeprefix("new "), line.get("tool", ""), line.get("direction", ""), *numbers]


def _lines(logbook: Logbook) -> list[dict[str, Any]]:
    """Tap tests, excluded ones, events, acknowledgements and test cuts, oldest first."""
    history = history_json(logbook)
    events = [
        event | {"kind": "new baseline" if event["new_baseline"] else "event", "name": event["id"]}
        for event in history["events"]
    ]
    excluded = [tap | {"kind": "excluded"} for tap in history["excluded"]]
    taps = [tap | {"kind": kind} for kind, name in (("tap", "taps"), ("kept", "kept")) for tap in history[name]]
    cuts = [_cut_line(cut) for cut in history["cuts"]]
    words = [
        {"kind": "ack", "id": word.alarm, "time": _utc(word.time), "text": f"{word.alarm}: {word}"}
        for word in logbook.files.acknowledgements
    ]
    return sorted([*events, *excluded, *taps, *cuts, *words], key=lambda line: line["time"])


def _cut_line(cut: Mapping[str, Any]) -> dict[str, Any]:
    """A test cut as the table shows it."""
    kind = "excluded" if cut["excluded"] else "cut"
    shown = {name: cut[name] for name in ("id", "time", "tool", "text")}
    return {**shown, "kind": kind, "name": cut["id"], "reason": cut["excluded"], "conditions": {}}


def _tap_json(row: Row, logbook: Logbook) -> dict[str, Any]:
    entry: dict[str, Any] = {"id": row.tap_id, "time": _utc(row.time), "tool": row.tool, "direction": row.direction}
    for name, field in VALUES.items():
        entry[name], entry[f"{name}_std"] = getattr(row, field)
    entry["baseline"] = None if row.baseline is None else _utc(row.baseline)
    entry["series"], entry["conditions"] = row.series, row.conditions.known
    entry["software"] = row.software or logbook.history.software
    entry["questions"] = [question.code for question in row.questions]
    words = row.rulings or {}
    entry["verdicts"] = {p.name: words[p.name].word.value for p in logbook.machine.program if p.name in words}
    return entry


def _excluded_json(tap: TapEntry) -> dict[str, Any]:
    time = _utc(datetime.fromisoformat(tap.time))
    named = {"id": tap.id, "time": time, "tool": tap.tool, "direction": tap.direction}
    return {**named, "conditions": tap.conditions.known, "reason": tap.excluded}


def _utc(time: datetime) -> str:
    """A time as text, all alike, so that they sort."""
    return time.astimezone(UTC).isoformat(timespec="microseconds")


def _cell(value: Any) -> Any:
    return "" if isinstance(value, float) and not math.isfinite(value) else value


def _number(line: Mapping[str, Any], name: str, scale: float) -> str:
    value = line.get(name, math.nan)
    return rounded(value, line[f"{name}_std"], scale) if math.isfinite(value) else ""


def _said(line: Mapping[str, Any]) -> str:
    """Its text or reason, conditions, what is asked, and the verdicts of then."""
    if "text" in line:
        return f"{line['text']}{'; ' + line['reason'] if line.get('reason') else ''}"
    under = conditions_texts(Conditions.of(line["conditions"]))
    if line["kind"] == "excluded":
        return "; ".join([line["reason"], *under])
    words = [f"{name}: {word}" for name, word in line["verdicts"].items()]
    return "; ".join([*under, *(f"question {code}" for code in line["questions"]), *words])


def conditions_texts(conditions: Conditions) -> list[str]:
    """Conditions of a tap test that are known, a few words each."""
    return [words.format(conditions.known[name]) for name, words in CONDITION_WORDS.items() if name in conditions.known]
