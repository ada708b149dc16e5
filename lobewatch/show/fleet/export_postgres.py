"""Export tap tests of many machines to a PostgreSQL table (extra `postgres`)."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from itertools import chain
from typing import Any, NamedTuple

from acquisition import DataError
from lobewatch.fleet.tap_table import TAP_NUMBER_COLUMNS, TapTable
from lobewatch.show.fleet.export_files import EXPORT_COLUMNS, ExportOutcome

POSTGRES_TABLE = "lobewatch_taps"
POSTGRES_BATCH_TAPS = 20_000
"""Tap tests from which on what was read is written in one transaction; chosen."""
POSTGRES_LOCK_WAIT = 60
"""Time for which another export is waited for (s); chosen."""
CONNECTION_TIMEOUTS = {"connect_timeout": 10, "keepalives_idle": 10, "keepalives_interval": 5, "keepalives_count": 4}
"""Settings (s) by which a server that is gone without a word is told; those in the address come first; chosen."""
KEY_COLUMNS = ("folder", "tap_id", "time")
"""Columns by which a line is known; with the time, as a hypertable wants it."""
COLUMN_TYPES = dict.fromkeys(TAP_NUMBER_COLUMNS, "double precision") | {"time": "timestamptz", "series": "integer"}
COLUMN_DEFINITIONS = ", ".join(f"{name} {COLUMN_TYPES.get(name, 'text')}" for name in EXPORT_COLUMNS)
CREATE_TABLE = f"""
CREATE TABLE IF NOT EXISTS {POSTGRES_TABLE}
  ({COLUMN_DEFINITIONS}, counts boolean NOT NULL, PRIMARY KEY ({", ".join(KEY_COLUMNS)}))
"""
CREATE_HYPERTABLE = f"SELECT create_hypertable('{POSTGRES_TABLE}', 'time', chunk_time_interval => INTERVAL '1 month')"
CREATE_INCOMING = (
    f"CREATE TEMPORARY TABLE incoming ({COLUMN_DEFINITIONS.replace('timestamptz', 'double precision')}) ON COMMIT DROP"
)
"""Lines as they are sent, the time in seconds since 1970."""
INCOMING_VALUES = ", ".join(
    "to_timestamp(time)" if n == "time" else f"nullif({n}, 'NaN')" if n in TAP_NUMBER_COLUMNS else n
    for n in EXPORT_COLUMNS
)
UPDATED_COLUMNS = [name for name in (*EXPORT_COLUMNS, "counts") if name not in KEY_COLUMNS]
UPSERT = f"""
INSERT INTO {POSTGRES_TABLE} SELECT {INCOMING_VALUES}, true FROM incoming
ON CONFLICT ({", ".join(KEY_COLUMNS)})
  DO UPDATE SET {", ".join(f"{name} = excluded.{name}" for name in UPDATED_COLUMNS)}
WHERE ({", ".join(f"{POSTGRES_TABLE}.{name}" for name in UPDATED_COLUMNS)})
  IS DISTINCT FROM ({", ".join(f"excluded.{name}" for name in UPDATED_COLUMNS)})
"""
MARK_EXCLUDED = f"""
UPDATE {POSTGRES_TABLE} AS stored SET counts = false WHERE counts AND folder = ANY(%s)
  AND NOT EXISTS (SELECT FROM incoming WHERE (incoming.folder, incoming.tap_id) = (stored.folder, stored.tap_id))
"""


POSTGRES_SCHEMES = ("postgresql://", "postgres://")
EXPORT_LOCK_QUERY = f"SELECT pg_advisory_xact_lock(hashtext('{POSTGRES_TABLE}'))"
HAS_TIMESCALE = "SELECT EXISTS (SELECT FROM pg_proc WHERE proname = 'create_hypertable')"
PSYCOPG_LOG = logging.getLogger("psycopg")
"""Log of what a lost connection cannot do any more; the error says it."""
PSYCOPG_LOG.addHandler(logging.NullHandler())
PSYCOPG_LOG.propagate = False


class _ExportCounts(NamedTuple):
    """Numbers of tap tests."""

    read: int
    """Number of those that were read."""
    written: int
    """Number of those that were not there, or otherwise."""
    set_aside: int
    """Number of those there that count no longer."""


def upsert_table(tables: Iterable[TapTable], address: str) -> ExportOutcome:
    """Have the table `lobewatch_taps` hold the tap tests as they are, in transactions of some machines each.

    Lines of these machines that count no longer stay, and say so. Machines are read while no other export writes. A
    hypertable where TimescaleDB is in the database. DataError without psycopg, for no address, and where the server
    cannot be reached, goes away or refuses; what it has taken until then stays.
    """
    place, remaining = server_name(address), iter(tables)
    total = _ExportCounts(0, 0, 0)
    with _connection(address, place) as connection:
        is_hypertable = _make_table(connection)
        while (counts := _write_next(connection, remaining)) is not None:
            total = _ExportCounts(*map(sum, zip(total, counts, strict=True)))
    kind = "a hypertable of TimescaleDB" if is_hypertable else "a plain table"
    sentences = [f"{POSTGRES_TABLE} is {kind}; {total.written} of them written, the others stand there as they are"]
    if total.set_aside:
        sentences.append(f"{total.set_aside} there count no longer")
    fields = {"written": total.written, "set_aside": total.set_aside, "hypertable": is_hypertable}
    return ExportOutcome(total.read, {"database": place, **fields}, sentences)


def server_name(address: str) -> str:
    """Host, port and database of an address, nothing that is secret; DataError for none, and without psycopg."""
    try:
        from psycopg import ProgrammingError
        from psycopg.conninfo import conninfo_to_dict
    except ImportError as error:
        raise DataError('--to needs psycopg; install it with: pip install "lobewatch[postgres]"') from error
    try:
        settings = conninfo_to_dict(address) if address.startswith(POSTGRES_SCHEMES) else {}
    except ProgrammingError:  # its text may hold the password
        settings = {}
    if not settings:
        cure = "give postgresql://USER@HOST:PORT/DATABASE, the password by PGPASSWORD or ~/.pgpass"
        raise DataError(f"--to: is no address of PostgreSQL; {cure}")
    return f"{settings.get('host', '')}:{settings.get('port', 5432)}/{settings.get('dbname', '')}"


@contextmanager
def _connection(address: str, place: str) -> Iterator[Any]:
    """A connection; DataError for whatever goes wrong with it."""
    import psycopg
    from psycopg.conninfo import conninfo_to_dict, make_conninfo

    given = conninfo_to_dict(address)
    watchful = make_conninfo(
        address, **{name: value for name, value in CONNECTION_TIMEOUTS.items() if name not in given}
    )
    try:
        with psycopg.connect(watchful, autocommit=True) as connection:
            connection.execute(f"SET lock_timeout = '{POSTGRES_LOCK_WAIT}s'")
            yield connection
    except psycopg.errors.LockNotAvailable:
        raise DataError(f"--to {place}: another export is writing there; wait until it is done") from None
    except psycopg.Error as error:
        reason = str(error).partition("\n")[0]
        cure = "what was written stays; the same command again writes what is missing"
        raise DataError(f"--to {place}: {reason}; {cure}") from None


def _make_table(connection: Any) -> bool:
    """Make the table where it is not there; whether it is a hypertable."""
    with connection.transaction(), connection.cursor() as cursor:
        cursor.execute(EXPORT_LOCK_QUERY)
        (is_new,) = cursor.execute("SELECT to_regclass(%s) IS NULL", [POSTGRES_TABLE]).fetchone()
        (has_timescale,) = cursor.execute(HAS_TIMESCALE).fetchone()
        if is_new:
            cursor.execute(CREATE_TABLE)
            if has_timescale:
                cursor.execute(CREATE_HYPERTABLE)
        return bool(has_timescale)


def _write_next(connection: Any, remaining: Iterator[TapTable]) -> _ExportCounts | None:
    """Read some machines more, and write them; None where there are none."""
    with connection.transaction(), connection.cursor() as cursor:
        cursor.execute(EXPORT_LOCK_QUERY)
        batch = _read_batch(remaining)
        if not batch:
            return None
        cursor.execute(CREATE_INCOMING)
        with cursor.copy("COPY incoming FROM STDIN") as copy:
            for row in chain.from_iterable(map(_table_rows, batch)):
                copy.write_row(row)
        written = cursor.execute(UPSERT).rowcount
        set_aside = cursor.execute(MARK_EXCLUDED, [[table.folder for table in batch]]).rowcount
    return _ExportCounts(sum(len(table.tap_id) for table in batch), written, set_aside)


def _read_batch(remaining: Iterator[TapTable]) -> list[TapTable]:
    batch, count = list[TapTable](), 0
    while count < POSTGRES_BATCH_TAPS and (table := next(remaining, None)) is not None:
        batch.append(table)
        count += len(table.tap_id)
    return batch


def _table_rows(table: TapTable) -> Iterator[Sequence[Any]]:
    """Lines in the order of the columns."""
    series = [(tool, direction, n) for n, (tool, direction) in enumerate(table.series, 1)]
    taps = zip(table.tap_id, table.time, table.series_numbers, table.numbers.tolist(), table.remarks, strict=True)
    for tap_id, time, number, numbers, remarks in taps:
        yield (table.folder, table.machine, tap_id, time, *series[number - 1], *numbers, remarks)
