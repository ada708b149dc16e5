"""Table of the measured points along tool, holder, spindle and column: points.csv of a folder."""

import csv
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from acquisition import DataError

POINT_TABLE_NAME = "points.csv"
"""Name of the table in the folder of the measurements."""
PARTS = "tool", "holder", "spindle", "column"
"""Parts of the machine from the tool tip on; the column is everything that does not rotate."""
REQUIRED_COLUMNS = "point", "position_mm", "part", "file"
"""Columns that every table has."""
OPTIONAL_COLUMNS = "role", "direction", "number", "node"
"""Columns that a table may have."""
DIRECTIONS = "x", "-x", "y", "-y", "z", "-z"
"""Directions of a sensor or hammer."""
MIN_POINTS = 3
"""Fewest points of a mode shape."""
ROLES = "response", "hit"
"""Roles of a point: sensor there and hammer at the tip, or hammer there and sensor at the tip."""


@dataclass(frozen=True)
class PointRow:
    """Line of the table: one measurement between a point and the tool tip."""

    where: str
    """Place of the line, for errors."""
    point: str
    """Name of the point."""
    position: float
    """Distance from the tool tip along the axis (m)."""
    part: str
    """Part of the machine, one of PARTS."""
    file: Path
    """Recorded file."""
    role: str = "response"
    """Role of the point, one of ROLES; unused at the tip, and with a node."""
    direction: str = ""
    """Direction at the point; empty for that of the tip."""
    number: int | None = None
    """Number of the response in the file, from 1; None if the file has only one."""
    node: int | None = None
    """Number of the point in the file, which then says what was measured there; None without."""


def read_point_table(folder: Path) -> tuple[PointRow, ...]:
    """Read points.csv, the point at the tool tip first, then by the distance from the tip.

    Raises DataError with line and point for a missing table or file, an unknown part, role or column, a number that is
    none, a point in two places, parts out of order, fewer than three points, and all points in one position.
    """
    path = folder / POINT_TABLE_NAME
    if not path.is_file():
        cure = f"Write one line per measurement, below the headings {','.join(REQUIRED_COLUMNS)}."
        raise DataError(f"{folder} has no {POINT_TABLE_NAME}. {cure}")
    rows = sorted((_parse_row(folder, *line) for line in _read_lines(path)), key=lambda row: row.position)
    _check_points(path, rows)
    return tuple(rows)


def _read_lines(path: Path) -> Iterator[tuple[str, Mapping[str, str]]]:
    """Yield the place and the cells of each line; semicolons go with decimal commas."""
    try:
        text = path.read_text("utf-8-sig")
    except UnicodeDecodeError as error:
        raise DataError(f"{path} is not UTF-8 text. Save it as CSV in UTF-8.") from error
    lines = text.splitlines()
    head = lines[0] if lines else ""
    separator = ";" if ";" in head else "\t" if "\t" in head else ","
    names = [name.strip().lower() for name in head.split(separator)]
    missing = [name for name in REQUIRED_COLUMNS if name not in names]
    unknown = [name for name in names if name not in (*REQUIRED_COLUMNS, *OPTIONAL_COLUMNS)]
    if missing or unknown or len({*names}) < len(names):
        finding = f"no column {missing[0]}" if missing else f"unknown or repeated column {(unknown or names)[0]!r}"
        allowed = f"Use the columns {', '.join(REQUIRED_COLUMNS)}, and if needed {', '.join(OPTIONAL_COLUMNS)}."
        raise DataError(f"{path}, line 1: {finding}. {allowed}")
    for number, cells in enumerate(csv.reader(lines[1:], delimiter=separator), 2):
        if len(cells) > len(names):
            raise DataError(f"{path}, line {number}: {len(cells)} values for {len(names)} columns. Correct this line.")
        row = dict.fromkeys(names, "") | {name: cell.strip() for name, cell in zip(names, cells, strict=False)}
        if any(row.values()):
            yield f"{path}, line {number}", row


def _parse_row(folder: Path, where: str, cells: Mapping[str, str]) -> PointRow:
    if not cells["point"]:
        raise DataError(f"{where}: the point has no name. Give each point a name.")
    where = f"{where}, point {cells['point']}"
    part = _parse_choice(where, "part", cells["part"].lower(), PARTS)
    role = _parse_choice(where, "role", cells.get("role", "").lower() or ROLES[0], ROLES)
    direction = cells.get("direction", "").lower().removeprefix("+")
    if direction:
        _parse_choice(where, "direction", direction, DIRECTIONS)
    number, node = (_parse_count(where, name, cells.get(name, "")) for name in ("number", "node"))
    if number and node:
        raise DataError(f"{where}: number {number} and node {node}. Give only one of the two.")
    file = folder / cells["file"]
    if not cells["file"] or not file.is_file():
        raise DataError(f"{where}: file {cells['file'] or '(no name)'} not found. Correct the column file.")
    position = _parse_position(where, cells["position_mm"])
    return PointRow(where, cells["point"], position, part, file, role, direction, number, node)


def _parse_choice(where: str, column: str, word: str, allowed: Sequence[str]) -> str:
    if word not in allowed:
        raise DataError(f"{where}: {column} {word!r} is unknown. Use {', '.join(allowed)}.")
    return word


def _parse_position(where: str, text: str) -> float:
    """Return a distance (m) from one in mm."""
    try:
        position = float(text.replace(",", ".")) / 1e3
    except ValueError:
        position = math.nan
    if not math.isfinite(position):
        raise DataError(f"{where}: position_mm {text!r} is not a number. Give the distance from the tool tip in mm.")
    return position


def _parse_count(where: str, column: str, text: str) -> int | None:
    if not text:
        return None
    if not (text.isascii() and text.isdigit() and int(text) > 0):
        raise DataError(f"{where}: {column} {text!r} is not a whole number above 0. Correct this value.")
    return int(text)


def _check_points(path: Path, rows: Sequence[PointRow]) -> None:
    """Check that each point is in one place, and that there are enough points."""
    places: dict[str, PointRow] = {}
    names: dict[tuple[float, str], str] = {}
    for row in rows:
        first = places.setdefault(row.point, row)
        if (first.position, first.part) != (row.position, row.part):
            both = f"{first.part} at {first.position * 1e3:g} mm and {row.part} at {row.position * 1e3:g} mm"
            raise DataError(f"{row.where}: duplicate name, {both}. Give each point its own name.")
        same = names.setdefault((row.position, row.part), row.point)
        if same != row.point:
            raise DataError(f"{row.where}: same position and part as point {same}. Give both the same name.")
    if len(places) < MIN_POINTS:
        raise DataError(f"{path}: {len(places)} points. A mode shape needs at least {MIN_POINTS} points.")
    if rows[0].position == rows[-1].position:
        finding = f"position_mm {rows[0].position * 1e3:g} for all points"
        raise DataError(f"{path}: {finding}. Give each point its distance from the tool tip in mm.")
    _check_order(rows)


def _check_order(rows: Sequence[PointRow]) -> None:
    """Check that the rotating parts follow each other from the tip on. The column may be around the spindle."""
    for row, behind in pairwise(row for row in rows if row.part != PARTS[-1]):
        if PARTS.index(behind.part) < PARTS.index(row.part):
            finding = f"{behind.part} behind point {row.point} of the {row.part}"
            raise DataError(f"{behind.where}: {finding}. Correct part or position_mm: the tip is at 0 mm.")
    if rows[0].part == PARTS[-1]:
        raise DataError(f"{rows[0].where}: the point nearest to the tip is on the column. Measure the tool tip too.")
