"""Tap tests of all machines as one file: SQLite, CSV, or Parquet by DuckDB. The same lines give the same bytes."""

from __future__ import annotations

import csv
import io
import secrets
import sqlite3
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing
from datetime import UTC, datetime
from functools import cache
from itertools import islice
from pathlib import Path

from acquisition import DataError
from lobewatch.analysis.plant.tap_table import TapLine

TEXTS = ("folder", "machine", "tap_id", "tool", "direction", "remarks")
NUMBERS = tuple(name for name in TapLine._fields if name not in (*TEXTS, "time", "series"))
DIGITS = 7
"""Significant digits of a number in CSV: a part in ten million, finer than any of them is known."""
TABLES = """
CREATE TABLE machine (id INTEGER PRIMARY KEY, folder TEXT NOT NULL, machine TEXT NOT NULL);
CREATE TABLE series (id INTEGER PRIMARY KEY, machine_id INTEGER NOT NULL REFERENCES machine, series INTEGER NOT NULL,
  tool TEXT NOT NULL, direction TEXT NOT NULL);
CREATE TABLE tap (series_id INTEGER NOT NULL REFERENCES series, tap_id TEXT NOT NULL, seconds REAL NOT NULL,
  remarks TEXT NOT NULL, {numbers});
CREATE VIEW taps AS SELECT folder, machine, tap_id, strftime('%Y-%m-%dT%H:%M:%SZ', seconds, 'unixepoch') AS time,
  tool, direction, series, {names}, remarks
  FROM tap JOIN series ON series.id = series_id JOIN machine ON machine.id = machine_id;
"""
"""One line a tap test is the view `taps`; what repeats stands once."""


def write_table(lines: Iterable[TapLine], path: Path) -> int:
    """Write a file by the ending of its name, whole or not at all; the number of tap tests.

    DataError for an ending that is not known, and for Parquet without DuckDB.
    """
    if path.suffix not in WRITERS:
        raise DataError(f"{path}: {path.suffix or 'no ending'} is no kind of table; give {', '.join(WRITERS)}")
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}.tmp")
    try:
        count = WRITERS[path.suffix](lines, temporary)
        temporary.replace(path)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error
    finally:
        temporary.unlink(missing_ok=True)
    return count


def _write_sqlite(lines: Iterable[TapLine], path: Path) -> int:
    with closing(sqlite3.connect(path, isolation_level=None)) as base:
        base.execute("PRAGMA journal_mode = OFF")
        base.execute("PRAGMA synchronous = OFF")  # a new file under another name: whole, or thrown away
        names = ", ".join(NUMBERS)
        base.executescript(TABLES.format(numbers=", ".join(f"{name} REAL" for name in NUMBERS), names=names))
        base.execute("BEGIN")
        marks = ", ".join("?" * (4 + len(NUMBERS)))
        count = base.executemany(f"INSERT INTO tap VALUES ({marks})", _filled(lines, base)).rowcount
        base.execute("COMMIT")
    return max(count, 0)


def _filled(lines: Iterable[TapLine], base: sqlite3.Connection) -> Iterator[tuple[object, ...]]:
    """Rows of `tap`; machines and series are written when they first appear."""
    machines: dict[str, int] = {}
    series: dict[tuple[str, int], int] = {}
    first = TapLine._fields.index(NUMBERS[0])
    for line in lines:
        key = line.folder, line.series
        if key not in series:
            if line.folder not in machines:
                machines[line.folder] = len(machines) + 1
                base.execute("INSERT INTO machine VALUES (?, ?, ?)", (machines[line.folder], line.folder, line.machine))
            series[key] = len(series) + 1
            told = series[key], machines[line.folder], line.series, line.tool, line.direction
            base.execute("INSERT INTO series VALUES (?, ?, ?, ?, ?)", told)
        yield series[key], line[2], line[3], line[-1], *map(_short, line[first:-1])  # type: ignore[arg-type]


def _short(value: float) -> float:
    """Whole where that is a part in ten million at most: SQLite keeps it in half the bytes."""
    return round(value) if value > 1e7 else value


def _write_csv(lines: Iterable[TapLine], path: Path) -> int:
    count, first = 0, TapLine._fields.index(NUMBERS[0])
    told, numbers = cache(_quoted), f"%.{DIGITS}g," * len(NUMBERS)
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(",".join(TapLine._fields) + "\n")
        for count, line in enumerate(lines, 1):  # noqa: B007 - the last one counts
            time = datetime.fromtimestamp(line.time, UTC).isoformat(timespec="seconds")[:19]
            texts = f"{told(line[0])},{told(line[1])},{line[2]},{time}Z,{told(line[4])},{line[5]},{line[6]},"
            file.write(f"{texts}{(numbers % line[first:-1]).replace('nan', '')}{line[-1]}\n")
    return count


def _quoted(text: str) -> str:
    """A name as a cell."""
    written = io.StringIO()
    csv.writer(written, lineterminator="").writerow([text])
    return written.getvalue()


def _write_parquet(lines: Iterable[TapLine], path: Path) -> int:
    try:
        import duckdb
    except ImportError as error:
        raise DataError('.parquet needs DuckDB; install it with: pip install "lobewatch[fleet]"') from error
    import numpy as np

    lines, parts, count = iter(lines), list[dict[str, np.ndarray]](), 0
    while some := list(islice(lines, 50_000)):
        count += len(some)
        columns = dict(zip(TapLine._fields, zip(*some, strict=True), strict=True))
        part = {name: np.array(values, dtype=object if name in TEXTS else None) for name, values in columns.items()}
        parts.append(part)
    whole = {name: np.concatenate([part[name] for part in parts]) for name in TapLine._fields}
    with closing(duckdb.connect(config={"threads": 1})) as base:
        base.register("lines", whole)
        named = ", ".join("to_timestamp(time)::TIMESTAMP AS time" if n == "time" else n for n in TapLine._fields)
        base.execute(f"COPY (SELECT {named} FROM lines) TO '{path.as_posix()}' (FORMAT parquet, COMPRESSION zstd)")
    return count


WRITERS: dict[str, Callable[[Iterable[TapLine], Path], int]] = {
    ".sqlite": _write_sqlite,
    ".csv": _write_csv,
    ".parquet": _write_parquet,
}
"""By the ending of the name."""
