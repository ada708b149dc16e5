"""Tap tests of all machines as one file: SQLite, CSV, or Parquet by DuckDB. The same tables give the same bytes."""

from __future__ import annotations

import gzip
import secrets
import sqlite3
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing
from pathlib import Path
from typing import IO

import msgspec
import numpy as np
from numpy.typing import NDArray

from acquisition import DataError
from lobewatch.plant.tap_table import NUMBERS, TapTable
from lobewatch.show.plant.export_outcome import ExportOutcome
from lobewatch.show.plant.table_columns import COLUMNS, table_lines, write_lines
from lobewatch.show.terminal.csv_text import csv_cell

DIGITS, DIGITS_OF_ERRORS = 7, 3
"""Significant digits of a number in CSV: a part in ten million, finer than any of them is known, and of its error."""
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
_TENS = 10.0 ** np.arange(23)
"""Powers of ten that are numbers of the computer."""

Floats = NDArray[np.float64]


def write_table(tables: Iterable[TapTable], path: Path) -> ExportOutcome:
    """Write a file by the ending of its name, whole or not at all.

    DataError for an ending that is not known, and for Parquet without DuckDB.
    """
    write = next((writer for ending, writer in WRITERS.items() if path.name.endswith(ending)), None)
    if write is None:
        raise DataError(f"{path}: {path.suffix or 'no ending'} is no kind of table; give {', '.join(WRITERS)}")
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}.tmp")
    try:
        count = write(tables, temporary)
        temporary.replace(path)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error
    finally:
        temporary.unlink(missing_ok=True)
    return ExportOutcome(count, {"file": str(path)})


def _write_sqlite(tables: Iterable[TapTable], path: Path) -> int:
    count = series = 0
    insert = f"INSERT INTO tap VALUES ({', '.join('?' * (4 + len(NUMBERS)))})"
    with closing(sqlite3.connect(path, isolation_level=None)) as base:
        base.execute("PRAGMA journal_mode = OFF")
        base.execute("PRAGMA synchronous = OFF")  # a new file under another name: whole, or thrown away
        names = ", ".join(NUMBERS)
        base.executescript(TABLES.format(numbers=", ".join(f"{name} REAL" for name in NUMBERS), names=names))
        base.execute("BEGIN")
        for machine, table in enumerate(tables, 1):
            base.execute("INSERT INTO machine VALUES (?, ?, ?)", (machine, table.folder, table.machine))
            series_rows = [(series + n, machine, n, *place) for n, place in enumerate(table.series, 1)]
            base.executemany("INSERT INTO series VALUES (?, ?, ?, ?, ?)", series_rows)
            of_series = [series + n for n in table.of_series]
            numbers = _short(table.numbers).T.tolist()
            base.executemany(insert, zip(of_series, table.tap_id, table.time, table.remarks, *numbers, strict=True))
            count, series = count + len(of_series), series + len(table.series)
        base.execute("COMMIT")
    return count


def _short(numbers: Floats) -> Floats:
    """Whole where that is a part in ten million at most: SQLite keeps it in half the bytes."""
    return np.where(numbers > 1e7, np.rint(numbers), numbers)


def _write_csv(tables: Iterable[TapTable], path: Path) -> int:
    with path.open("wb") as file:
        return _write_lines(tables, file)


def _write_zipped(tables: Iterable[TapTable], path: Path) -> int:
    with path.open("wb") as file, gzip.GzipFile("", "wb", 1, file, mtime=0) as zipped:
        return _write_lines(tables, zipped)


def _write_lines(tables: Iterable[TapTable], file: IO[bytes] | gzip.GzipFile) -> int:
    count = 0
    file.write(",".join(COLUMNS).encode() + b"\n")
    for table in tables:
        file.write("".join(_lines(table)).encode())
        count += len(table.tap_id)
    return count


def _lines(table: TapTable) -> Iterator[str]:
    begin = f"{csv_cell(table.folder)},{csv_cell(table.machine)},"
    series = [f"{csv_cell(tool)},{direction},{n}" for n, (tool, direction) in enumerate(table.series, 1)]
    times = np.datetime_as_string(np.floor(table.time).astype("datetime64[s]")).tolist()
    taps = zip(table.tap_id, times, table.of_series, _cells(table.numbers), table.remarks, strict=True)
    return (f"{begin}{tap_id},{time}Z,{series[n - 1]},{cells},{remarks}\n" for tap_id, time, n, cells, remarks in taps)


def _cells(numbers: Floats) -> list[str]:
    """Cells of each line with commas between, by the encoder of JSON, which is quick; nothing for NaN."""
    if not len(numbers):
        return []
    digits = np.array([DIGITS_OF_ERRORS if name.endswith("_std") else DIGITS for name in NUMBERS])
    cells = msgspec.json.encode(rounded(numbers, digits).tolist()).decode()
    return cells[2:-2].replace("null", "").replace(".0,", ",").split("],[")


def rounded(values: Floats, digits: NDArray[np.intp]) -> Floats:
    """Values to significant digits, of each column (n, c) its own (c,); fewer of what is below 1e-16."""
    with np.errstate(divide="ignore", invalid="ignore"):
        places = digits - 1 - np.floor(np.log10(np.abs(values)))
    places = np.clip(np.nan_to_num(places), 1 - _TENS.size, _TENS.size - 1).astype(np.intp)
    up, down = _TENS[np.maximum(places, 0)], _TENS[np.maximum(-places, 0)]
    return np.asarray(np.rint(values * up / down) * down / up)


def _write_parquet(tables: Iterable[TapTable], path: Path) -> int:
    with table_lines(tables, ".parquet") as base:
        return write_lines(base, "SELECT * FROM lines", path)


WRITERS: dict[str, Callable[[Iterable[TapTable], Path], int]] = {
    ".sqlite": _write_sqlite,
    ".csv": _write_csv,
    ".csv.gz": _write_zipped,
    ".parquet": _write_parquet,
}
"""Writer of a table by the ending of the file name."""
