"""How the machines of a folder stand, for the terminal and as CSV; hundreds of them in no time."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime
from typing import Any

from rich.cells import cell_len

from lobewatch.show.terminal.csv_text import csv_text
from lobewatch.show.terminal.output import printable

COLUMNS = ("key", "name", "light", "fall", "fall_std", "series", "last_tap", "days_left", "note", "next_step")
"""Keys of a row of the dashboard, in the order of the CSV."""
HEADINGS = ("folder", "machine", "light", "fallen (%)", "last tap", "limit ahead", "why", "next")
NARROWEST = 24
"""Width of the last two columns at least, which are broken to fit."""


def plant_text(rows: Sequence[Mapping[str, Any]], width: int) -> str:
    """A line a machine, with its worst reason; more where texts do not fit into the width."""
    lines = [HEADINGS, *map(_cells, rows)]
    widths = [max(cell_len(line[i]) for line in lines) for i in range(len(HEADINGS) - 2)]
    left = max((width - sum(widths) - 2 * len(widths) - 2) // 2, NARROWEST)
    return "\n".join(text for line in lines for text in _broken(line, [*widths, left, left]))


def plant_csv(rows: Sequence[Mapping[str, Any]]) -> str:
    """A line a machine below the headings."""
    return csv_text([COLUMNS, *([row[name] for name in COLUMNS] for row in rows)])


def _cells(row: Mapping[str, Any]) -> tuple[str, ...]:
    first, *further = row["reasons"] or [""]
    why = f"{first} (and {len(further)} more)" if further else first
    light = f"{'early ' if row['is_early'] else ''}{row['light'].value}"
    cells = row["key"], row["name"], light, _fallen(row), _due(row), row["limit"], why, row["next_step"]
    return tuple(printable(cell).replace("\n", " ").replace("\t", " ") for cell in cells)


def _broken(cells: Sequence[str], widths: Sequence[int]) -> Iterator[str]:
    why, step = (textwrap.wrap(text, widths[-1], break_long_words=False, break_on_hyphens=False) for text in cells[-2:])
    for i in range(max(len(why), len(step), 1)):
        parts = [
            *(cells[:-2] if i == 0 else [""] * (len(cells) - 2)),
            *(lines[i] if i < len(lines) else "" for lines in (why, step)),
        ]
        yield "  ".join(part + " " * (wide - cell_len(part)) for part, wide in zip(parts, widths, strict=True)).rstrip()


def _fallen(row: Mapping[str, Any]) -> str:
    if row["fall"] is None:
        return ""
    return f"{row['fall']:.2f}" + ("" if row["fall_std"] is None else f" ± {row['fall_std']:.2f}")


def _due(row: Mapping[str, Any]) -> str:
    left = row["days_left"]
    if left is None:
        return ""
    last = f"{datetime.fromisoformat(row['last_tap']).astimezone():%Y-%m-%d}"
    return f"{last}, " + (f"due in {math.floor(left)} d" if left >= 0 else f"{math.ceil(-left)} d overdue")
