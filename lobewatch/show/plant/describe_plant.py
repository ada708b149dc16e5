"""How the machines of a folder stand."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any

from rich.table import Table

from dsm import plus_minus
from lobewatch.show.output import table

COLUMNS = ("key", "name", "light", "fall", "fall_std", "series", "last_tap", "days_left", "note", "next_step")
"""Keys of a row of the dashboard, in the order of the CSV."""


def plant_table(rows: Sequence[Mapping[str, Any]]) -> Table:
    """A line a machine, with its worst reason."""
    made = table("~folder", "~machine", "<light", "fallen (%)", "~last tap", "~why", "~next")
    for row in rows:
        first, *others = row["reasons"] or [""]
        why = f"{first} (and {len(others)} more)" if others else first
        made.add_row(row["key"], row["name"], row["light"].value, _fallen(row), _due(row), why, row["next_step"])
    return made


def plant_csv(rows: Sequence[Mapping[str, Any]]) -> str:
    """A line a machine below the headings."""
    written = io.StringIO()
    writer = csv.DictWriter(written, COLUMNS, extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return written.getvalue()


def _fallen(row: Mapping[str, Any]) -> str:
    if row["fall"] is None:
        return ""
    return plus_minus(row["fall"], math.nan if row["fall_std"] is None else row["fall_std"])


def _due(row: Mapping[str, Any]) -> str:
    left = row["days_left"]
    if left is None:
        return ""
    last = f"{datetime.fromisoformat(row['last_tap']).astimezone():%Y-%m-%d}"
    return f"{last}, " + (f"due in {math.floor(left)} d" if left >= 0 else f"{math.ceil(-left)} d overdue")
