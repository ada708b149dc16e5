"""Tap tests of all machines as columns, and as the table `lines` of DuckDB (extra `fleet`)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition import DataError
from lobewatch.plant.tap_table import NUMBERS, TapTable

COLUMNS = ("folder", "machine", "tap_id", "time", "tool", "direction", "series", *NUMBERS, "remarks")
"""Columns of a line, in order."""
NOTHING = TapTable("", "", (), (), (), (), (), np.empty((0, len(NUMBERS))))


@contextmanager
def table_lines(tables: Iterable[TapTable], purpose: str) -> Iterator[Any]:
    """A connection to DuckDB in memory that has the lines; DataError, which names the purpose, without DuckDB and for
    what it cannot read or write."""
    try:
        import duckdb
    except ImportError as error:
        raise DataError(f'{purpose} needs DuckDB; install it with: pip install "lobewatch[fleet]"') from error
    parts = [_columns(table) for table in tables] or [_columns(NOTHING)]
    whole = {name: np.concatenate([part[name] for part in parts]) for name in COLUMNS}
    named = ", ".join("to_timestamp(time)::TIMESTAMP AS time" if n == "time" else n for n in COLUMNS)
    with closing(duckdb.connect(config={"threads": 1})) as base:
        base.register("whole", whole)
        try:
            base.execute(f"CREATE TABLE lines AS SELECT {named} FROM whole")
            yield base
        except duckdb.Error as error:
            raise DataError(f"{purpose}: {error}") from error


def write_lines(base: Any, query: str, path: Path) -> int:
    """Write what a query gives as Parquet; the number of lines."""
    name = path.as_posix().replace("'", "''")
    return int(base.execute(f"COPY ({query}) TO '{name}' (FORMAT parquet, COMPRESSION zstd)").fetchone()[0])


def _columns(table: TapTable) -> dict[str, NDArray[Any]]:
    """Columns of a table as arrays, by name."""
    n, of_series = len(table.tap_id), np.array(table.of_series, np.int64)
    tools, directions = (np.array([place[part] for place in table.series], object) for part in (0, 1))
    return {
        "folder": np.full(n, table.folder, object),
        "machine": np.full(n, table.machine, object),
        "tap_id": np.array(table.tap_id, object),
        "time": np.array(table.time, np.float64),
        "tool": tools[of_series - 1],
        "direction": directions[of_series - 1],
        "series": of_series,
        "remarks": np.array(table.remarks, object),
        **dict(zip(NUMBERS, table.numbers.T, strict=True)),
    }
