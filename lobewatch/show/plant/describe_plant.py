"""How the machines of a folder stand, for the terminal and as CSV; hundreds of them in no time."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any

from rich.cells import cell_len, set_cell_size

from dsm import plus_minus
from lobewatch.show.terminal.csv_text import csv_text
from lobewatch.show.terminal.output import printable

COLUMNS = ("key", "name", "light", "fall", "fall_std", "series", "last_tap", "days_left", "note", "next_step")
"""Keys of a row of the dashboard, in the order of the CSV."""
HEADINGS = ("machine", "light", "fallen (%)", "last tap", "limit ahead")


def plant_text(rows: Sequence[Mapping[str, Any]]) -> str:
    """A line a machine, with its worst reason and the next step below it."""
    lines = [HEADINGS, *map(_cells, rows)]
    widths = [max(map(cell_len, column)) for column in zip(*lines, strict=True)]
    shown = ["  ".join(map(set_cell_size, line, widths)).rstrip() for line in lines]
    texts = [[], *map(_texts, rows)]
    return "\n".join(part for line, below in zip(shown, texts, strict=True) for part in (line, *below))


def plant_csv(rows: Sequence[Mapping[str, Any]]) -> str:
    """A line a machine below the headings."""
    return csv_text([COLUMNS, *([row[name] for name in COLUMNS] for row in rows)])


def _cells(row: Mapping[str, Any]) -> tuple[str, ...]:
    light = f"{'early ' if row['is_early'] else ''}{row['light'].value}"
    return _one_line(row["key"]), light, _fallen(row), _due(row), row["limit"]


def _texts(row: Mapping[str, Any]) -> list[str]:
    """Its name where the folder has another, the worst reason, and what to do."""
    first, *further = row["reasons"] or [row["why"]]
    why = first + (f" (and {len(further)} more)" if further else "")
    named = row["name"] if row["name"] != row["key"] else ""
    return [f"  {_one_line(text)}" for text in (": ".join(filter(None, (named, why))), row["next_step"]) if text]


def _one_line(text: str) -> str:
    return printable(text).replace("\n", " ").replace("\t", " ")


def _fallen(row: Mapping[str, Any]) -> str:
    if row["fall"] is None:
        return ""
    if row["fall_std"] == 0:
        return "first test"
    return plus_minus(row["fall"], row["fall_std"])


def _due(row: Mapping[str, Any]) -> str:
    left = row["days_left"]
    if left is None:
        return ""
    last = f"{datetime.fromisoformat(row['last_tap']).astimezone():%Y-%m-%d}"
    return f"{last}, " + (f"due in {math.floor(left)} d" if left >= 0 else f"{math.ceil(-left)} d overdue")
