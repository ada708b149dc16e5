"""The report of all machines of a folder: one page, worst first."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

from dsm import plus_minus
from lobewatch.decay.light import Light
from lobewatch.show.plant.describe_plant import COLUMNS
from lobewatch.show.report.figure_data import Numbers
from lobewatch.show.report.gauge import gauge
from lobewatch.show.report.page import page, write_page
from lobewatch.show.terminal.light_words import light_kind
from lobewatch.verdicts.verdict import Word

WIDE, HIGH = 140, 32
"""Size of a small course, in its own units."""


def write_fleet_report(rows: Sequence[Mapping[str, Any]], folder: Path, path: Path | None, now: datetime) -> Path:
    """Write the report of some machines, as `plant_rows` tells them; path None: report.html in their folder."""
    path = path or folder / "report.html"
    write_page(path, render_fleet(rows, folder.resolve().name, now))
    return path


def render_fleet(rows: Sequence[Mapping[str, Any]], name: str, now: datetime) -> str:
    """HTML of a line a machine, in the order of the rows."""
    lights = [row["light"] for row in rows]
    counts = ", ".join(f"{lights.count(light)} {light.value}" for light in Light if light in lights)
    numbers = Numbers(COLUMNS, [[_plain(row[column]) for column in COLUMNS] for row in rows])
    machines = [_machine(row) for row in rows]
    return page("fleet.html", name=name, now=now, counts=counts, machines=machines, numbers=numbers)


def _plain(value: Any) -> Any:
    return value.value if isinstance(value, Light) else value


def _machine(row: Mapping[str, Any]) -> dict[str, Any]:
    """A machine as the template takes it."""
    left, last = row["days_left"], row["last_tap"]
    due = (
        "never tapped" if left is None else f"in {math.floor(left)} d" if left >= 0 else f"{math.ceil(-left)} d overdue"
    )
    fall, std = row["fall"], row["fall_std"]
    has_changed = fall is not None and std != 0
    fallen = f"{plus_minus(-fall, std)} %" if has_changed else "nothing to compare with"
    return {
        "name": row["name"],
        "key": row["key"],
        "light": row["word"],
        "kind": light_kind(row["light"], row["is_early"]),
        "reasons": row["reasons"] or [row["why"] or ("all is well" if row["light"] is Light.GOOD else "-")],
        "next_step": row["next_step"],
        "fallen": fallen,
        "gauge": gauge(fall, *row["limits"]) if has_changed else None,
        "series": row["series"],
        "spark": spark(row["points"]),
        "until": row["limit"],
        "programs": programs_text(row["programs"]),
        "due": f"{due}, last {last.partition('T')[0]}" if last else due,
    }


def programs_text(words: Mapping[str, str]) -> str:
    """The programs that may not be run, by the word on them, and how many are stable."""
    named: dict[str, list[str]] = {}
    for program, word in words.items():
        named.setdefault(word, []).append(program)
    stable = named.pop(Word.STABLE, [])
    texts = [f"{word}: {', '.join(programs)}" for word, programs in named.items()]
    return "; ".join([*texts, *([f"{len(stable)} stable"] if stable else [])]) or "-"


def spark(points: Sequence[tuple[float, float]]) -> str:
    """The course of a series (days, %) as the points of a small polyline; empty below two points."""
    if len(points) < 2:
        return ""
    days, percents = zip(*points, strict=True)
    span, reach = days[-1] - days[0], max(max(percents) - min(percents), 1.0)
    places = (
        (WIDE * (day - days[0]) / (span or 1.0), HIGH * (max(percents) - percent) / reach) for day, percent in points
    )
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in places)
