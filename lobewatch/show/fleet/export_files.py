"""Export tap tests of many machines to SQLite, CSV or Parquet files."""

import glob
import gzip
import os
import secrets
import sqlite3
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, nullcontext
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from acquisition import DataError
from acquisition.errors import join_sentences
from acquisition.file_io import check_file_name, delete, make_folder, rename, sync_folder
from lobewatch.arrays import Floats, Indices
from lobewatch.fleet.tap_table import TAP_NUMBER_COLUMNS, TapTestTable
from lobewatch.machine.folder_lock import FolderLock
from lobewatch.show.terminal.output import format_csv_cell


class ExportOutcome(NamedTuple):
    """Exported tap tests, and sentences on the export."""

    tap_tests: int
    """Number of tap tests of all machines that could be read."""
    fields: Mapping[str, Any]
    """JSON keys and values, the destination first."""
    sentences: Sequence[str] = ()
    """Sentences for people."""


EXPORT_COLUMNS = ("folder", "machine", "tap_id", "time", "tool", "direction", "series", *TAP_NUMBER_COLUMNS, "remarks")
"""Columns of an exported row, in order."""
EMPTY_TABLE = TapTestTable("", "", (), (), (), (), (), np.empty((0, len(TAP_NUMBER_COLUMNS))))


@contextmanager
def open_duckdb(tables: Iterable[TapTestTable], purpose: str) -> Iterator[Any]:
    """Open a DuckDB connection in memory with the tap tests as the table `lines`.

    Raise DataError, which names the purpose, without DuckDB and for files that it cannot read or write.
    """
    try:
        import duckdb
    except ImportError as error:
        raise DataError(f'{purpose} needs DuckDB. Install it with pip install "lobewatch[fleet]".') from error
    parts = [_table_arrays(table) for table in tables] or [_table_arrays(EMPTY_TABLE)]
    whole = {name: np.concatenate([part[name] for part in parts]) for name in EXPORT_COLUMNS}
    named = ", ".join("to_timestamp(time)::TIMESTAMP AS time" if n == "time" else n for n in EXPORT_COLUMNS)
    with closing(duckdb.connect(config={"threads": 1})) as base:
        base.register("whole", whole)
        try:
            base.execute(f"CREATE TABLE lines AS SELECT {named} FROM whole")
            yield base
        except duckdb.Error as error:
            raise DataError(f"{purpose}: {error}") from error


def write_parquet(base: Any, query: str, path: Path) -> int:
    """Write the result of a query as Parquet, and return the number of lines."""
    name = path.as_posix().replace("'", "''")
    return int(base.execute(f"COPY ({query}) TO '{name}' (FORMAT parquet, COMPRESSION zstd)").fetchone()[0])


def _table_arrays(table: TapTestTable) -> dict[str, NDArray[Any]]:
    """Return the columns of a table as arrays, by name."""
    n, of_series = len(table.tap_id), np.array(table.series_numbers, np.int64)
    tools, directions = (np.array([place[part] for place in table.series], object)[of_series - 1] for part in (0, 1))
    columns = {name: np.full(n, getattr(table, name), object) for name in ("folder", "machine")}
    columns |= {name: np.array(getattr(table, name), object) for name in ("tap_id", "remarks")}
    columns |= {"time": np.array(table.time, np.float64), "tool": tools, "direction": directions, "series": of_series}
    return columns | dict(zip(TAP_NUMBER_COLUMNS, table.numbers.T, strict=True))


CSV_DIGITS, CSV_ERROR_DIGITS = 7, 3
"""Significant digits of a number in CSV, a tenth of a millionth at worst, and of its standard error."""
SQLITE_SCHEMA = """
CREATE TABLE machine (id INTEGER PRIMARY KEY, folder TEXT NOT NULL, machine TEXT NOT NULL);
CREATE TABLE series (id INTEGER PRIMARY KEY, machine_id INTEGER NOT NULL REFERENCES machine, series INTEGER NOT NULL,
  tool TEXT NOT NULL, direction TEXT NOT NULL);
CREATE TABLE tap (series_id INTEGER NOT NULL REFERENCES series, tap_id TEXT NOT NULL, seconds REAL NOT NULL,
  remarks TEXT NOT NULL, {numbers});
CREATE VIEW taps AS SELECT folder, machine, tap_id, strftime('%Y-%m-%dT%H:%M:%SZ', seconds, 'unixepoch') AS time,
  tool, direction, series, {names}, remarks
  FROM tap JOIN series ON series.id = series_id JOIN machine ON machine.id = machine_id;
"""
"""Normalized tables; the view `taps` has a row for each tap test."""
_POWERS_OF_TEN = 10.0 ** np.arange(23)
"""Powers of ten that are exact floating-point numbers."""


def write_table(tables: Iterable[TapTestTable], path: Path) -> ExportOutcome:
    """Write a complete file in the format of its ending, or none.

    Raise DataError for an unsupported ending, and for Parquet without DuckDB.
    """
    write = next((writer for ending, writer in TABLE_WRITERS.items() if path.name.endswith(ending)), None)
    if write is None:
        finding = f"{path}: unsupported file type {path.suffix!r}"
        raise DataError(join_sentences(finding, f"Use a name with the ending {', '.join(TABLE_WRITERS)}"))
    check_file_name(path)
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}.tmp")
    try:
        count = write(tables, temporary)
        rename(temporary, path)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error
    finally:
        delete(temporary, missing_ok=True)
    return ExportOutcome(count, {"file": str(path)})


def _write_sqlite(tables: Iterable[TapTestTable], path: Path) -> int:
    count = series = 0
    with closing(sqlite3.connect(path, isolation_level=None)) as base:
        base.execute("PRAGMA journal_mode = OFF")
        base.execute("PRAGMA synchronous = OFF")  # a new file under another name: whole, or thrown away
        numbers = ", ".join(f"{name} REAL" for name in TAP_NUMBER_COLUMNS)
        base.executescript(SQLITE_SCHEMA.format(numbers=numbers, names=", ".join(TAP_NUMBER_COLUMNS)))
        base.execute("BEGIN")
        for machine, table in enumerate(tables, 1):
            base.execute("INSERT INTO machine VALUES (?, ?, ?)", (machine, table.folder, table.machine))
            series_rows = [(series + n, machine, n, *place) for n, place in enumerate(table.series, 1)]
            base.executemany("INSERT INTO series VALUES (?, ?, ?, ?, ?)", series_rows)
            of_series = [series + n for n in table.series_numbers]
            values = np.where(table.numbers > 1e7, np.rint(table.numbers), table.numbers)  # integers: half the bytes
            taps = zip(of_series, table.tap_id, table.time, table.remarks, *values.T.tolist(), strict=True)
            base.executemany(f"INSERT INTO tap VALUES ({', '.join('?' * (4 + len(TAP_NUMBER_COLUMNS)))})", taps)
            count, series = count + len(of_series), series + len(table.series)
        base.execute("COMMIT")
    return count


def _write_csv(tables: Iterable[TapTestTable], path: Path, *, zipped: bool = False) -> int:
    count = 0
    with path.open("wb") as file, gzip.GzipFile("", "wb", 1, file, mtime=0) if zipped else nullcontext(file) as out:
        out.write(",".join(EXPORT_COLUMNS).encode() + b"\n")
        for table in tables:
            out.write("".join(_csv_rows(table)).encode())
            count += len(table.tap_id)
    return count


def _csv_rows(table: TapTestTable) -> Iterator[str]:
    begin = f"{format_csv_cell(table.folder)},{format_csv_cell(table.machine)},"
    series = [f"{format_csv_cell(tool)},{direction},{n}" for n, (tool, direction) in enumerate(table.series, 1)]
    times = np.datetime_as_string(np.floor(table.time).astype("datetime64[s]")).tolist()
    taps = zip(table.tap_id, times, table.series_numbers, _number_cells(table.numbers), table.remarks, strict=True)
    return (f"{begin}{tap_id},{time}Z,{series[n - 1]},{cells},{remarks}\n" for tap_id, time, n, cells, remarks in taps)


def _number_cells(numbers: Floats) -> list[str]:
    """Return the numbers of each row joined by commas, NaN as empty cells; the JSON encoder is fast."""
    if not len(numbers):
        return []
    digits = np.array([CSV_ERROR_DIGITS if name.endswith("_std") else CSV_DIGITS for name in TAP_NUMBER_COLUMNS])
    cells = msgspec.json.encode(round_significant(numbers, digits).tolist()).decode()
    return cells[2:-2].replace("null", "").replace(".0,", ",").split("],[")


def round_significant(values: Floats, digits: Indices) -> Floats:
    """Round values (n, c) to the significant digits of each column (c,); to fewer digits below 1e-16."""
    with np.errstate(divide="ignore", invalid="ignore"):
        places = digits - 1 - np.floor(np.log10(np.abs(values)))
    places = np.clip(np.nan_to_num(places), 1 - _POWERS_OF_TEN.size, _POWERS_OF_TEN.size - 1).astype(np.intp)
    up, down = _POWERS_OF_TEN[np.maximum(places, 0)], _POWERS_OF_TEN[np.maximum(-places, 0)]
    return np.asarray(np.rint(values * up / down) * down / up)


def _write_parquet(tables: Iterable[TapTestTable], path: Path) -> int:
    with open_duckdb(tables, ".parquet") as base:
        return write_parquet(base, "SELECT * FROM lines", path)


TABLE_WRITERS: dict[str, Callable[[Iterable[TapTestTable], Path], int]] = {
    ".sqlite": _write_sqlite,
    ".csv": _write_csv,
    ".csv.gz": partial(_write_csv, zipped=True),
    ".parquet": _write_parquet,
}
"""Writer of a table for each file name extension."""


EXPORT_LOCK_WAIT = 60.0
"""Longest wait for another export into the same folder (s); chosen."""
MISSING_QUERY = """
CREATE TABLE missing AS SELECT strftime(time, '%Y-%m') AS month, * FROM lines ANTI JOIN present USING (folder, tap_id)
"""
OUTDATED_QUERY = """
SELECT DISTINCT month FROM present LEFT JOIN lines USING (folder, tap_id)
WHERE folder IN (SELECT unnest(?::VARCHAR[])) AND (lines.time IS NULL OR {differ}) ORDER BY month
"""


def append_months(tables: Iterable[TapTestTable], folder: Path) -> ExportOutcome:
    """Add missing tap tests to a folder as `month=YYYY-MM/*.parquet` (month in UTC), each file complete or not written.

    Folder and tap_id identify a tap test. Existing files are never changed. Raise DataError without DuckDB, for a file
    that is no such table, and if another export takes longer than EXPORT_LOCK_WAIT.
    """
    tables = [*tables]
    with open_duckdb(tables, f"--append {folder}") as base:
        make_folder(folder)
        with FolderLock(folder).hold(EXPORT_LOCK_WAIT):
            for left in folder.glob("month=*/.*.tmp"):  # of an export that was killed
                delete(left)
            _load_existing(base, folder)
            base.execute(MISSING_QUERY)
            months = base.execute("SELECT DISTINCT month FROM missing ORDER BY month").fetchall()
            added = sum(_write_month(base, folder, month) for (month,) in months)
        (count,) = base.execute("SELECT count(*) FROM lines").fetchone()
        differ = " OR ".join(f"present.{name} IS DISTINCT FROM lines.{name}" for name in EXPORT_COLUMNS[3:])
        query = OUTDATED_QUERY.format(differ=differ)
        outdated = [month for (month,) in base.execute(query, [[table.folder for table in tables]]).fetchall()]
    sentences = [f"{added} tap tests new in this folder"]
    if outdated:
        months = ", ".join(f"month={month}" for month in outdated)
        folders = "this folder" if len(outdated) == 1 else "these folders"
        finding = f"{months}: some tap tests were excluded or analysed again after their export"
        sentences.append(join_sentences(finding, f"Delete {folders} and export again to update the tap tests"))
    return ExportOutcome(count, {"folder": str(folder), "added": added, "outdated_months": outdated}, sentences)


def _load_existing(base: Any, folder: Path) -> None:
    """Load the existing rows as the table `present`."""
    base.execute("CREATE TABLE present AS SELECT *, '' AS month FROM lines LIMIT 0")
    files = [glob.escape(str(file)) for file in sorted(folder.glob("month=*/*.parquet"))]
    if files:
        read = "read_parquet(?, hive_partitioning = true, hive_types_autocast = false, union_by_name = true)"
        base.execute(f"INSERT INTO present BY NAME SELECT {', '.join(EXPORT_COLUMNS)}, month FROM {read}", [files])


def _write_month(base: Any, folder: Path, month: str) -> int:
    """Write a file whose name is a hash of its tap tests, so that the same tap tests never exist under two names."""
    lines = f"SELECT * EXCLUDE (month) FROM missing WHERE month = '{month}' ORDER BY folder, time, tap_id"
    keys = f"SELECT md5(string_agg(folder || chr(10) || tap_id, chr(10))) FROM ({lines})"
    name = f"{base.execute(keys).fetchone()[0]}.parquet"
    place = folder / f"month={month}"
    make_folder(place)
    temporary = place / f".{name}.tmp"
    try:
        count = write_parquet(base, lines, temporary)
        with temporary.open("rb") as file:
            os.fsync(file.fileno())
        rename(temporary, place / name)
    finally:
        delete(temporary, missing_ok=True)
    sync_folder(place)
    return count
