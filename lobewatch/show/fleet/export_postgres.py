"""Export tap tests of many machines to a PostgreSQL table (extra `postgres`)."""

import logging
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from itertools import chain
from typing import Any

from acquisition import DataError
from acquisition.credentials import split_password
from acquisition.errors import join_sentences
from lobewatch.fleet.tap_table import TAP_NUMBER_COLUMNS, TapTestTable
from lobewatch.show.fleet.export_files import EXPORT_COLUMNS, ExportOutcome

POSTGRES_TABLE = "lobewatch_taps"
POSTGRES_BATCH_TAPS = 20_000
"""Smallest number of tap tests written in one transaction; chosen."""
POSTGRES_LOCK_WAIT = 60
"""Longest wait for another export (s); chosen."""
CONNECTION_TIMEOUTS = {"connect_timeout": 10, "keepalives_idle": 10, "keepalives_interval": 5, "keepalives_count": 4}
"""Settings (s) that detect a server that no longer answers, unless the address sets them; chosen."""
KEY_COLUMNS = ("folder", "tap_id", "time")
"""Columns that identify a row; a hypertable needs the time among them."""
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
"""Rows as they are sent, the time in seconds since 1970."""
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


EXPORT_LOCK_QUERY = f"SELECT pg_advisory_xact_lock(hashtext('{POSTGRES_TABLE}'))"
HAS_TIMESCALE = "SELECT EXISTS (SELECT FROM pg_proc WHERE proname = 'create_hypertable')"
PSYCOPG_LOG = logging.getLogger("psycopg")
"""Log of the driver about lost connections, which the error message covers."""
PSYCOPG_LOG.addHandler(logging.NullHandler())
PSYCOPG_LOG.propagate = False


def upsert_table(tables: Iterable[TapTestTable], address: str) -> ExportOutcome:
    """Update the table `lobewatch_taps` to the tap tests of the machines, in transactions of a few machines each.

    Rows that no longer count stay and are marked. Each transaction reads its machines while no other export writes.
    With TimescaleDB the table becomes a hypertable. Raise DataError without psycopg, for an invalid address, and if
    the server fails. Rows written before that stay.
    """
    address, password = split_password(address)
    place, remaining = server_name(address), iter(tables)
    read = written = set_aside = 0
    with _connection(address, password, place) as connection:
        is_hypertable = _make_table(connection)
        while (counts := _write_next(connection, remaining)) is not None:
            read, written, set_aside = read + counts[0], written + counts[1], set_aside + counts[2]
    kind = "a hypertable of TimescaleDB" if is_hypertable else "a plain table"
    sentences = [f"{POSTGRES_TABLE} is {kind}, {written} rows added or changed"]
    sentences += [f"{set_aside} stored rows marked as excluded (counts = false)"] if set_aside else []
    fields = {"database": place, "written": written, "set_aside": set_aside, "hypertable": is_hypertable}
    return ExportOutcome(read, fields, sentences)


def server_name(address: str) -> str:
    """Return host, port and database of an address, without secrets; raise DataError for an invalid one."""
    try:
        from psycopg import ProgrammingError
        from psycopg.conninfo import conninfo_to_dict
    except ImportError as error:
        raise DataError('--to needs psycopg. Install it with pip install "lobewatch[postgres]".') from error
    try:
        settings = conninfo_to_dict(address) if address.startswith(("postgresql://", "postgres://")) else {}
    except ProgrammingError:  # its text may hold the password
        settings = {}
    ports = str(settings.get("port", "")).replace(",", "")
    if not settings or (ports and not ports.isdecimal()):  # a password without "@HOST" is read as the port
        cure = "Use postgresql://USER@HOST:PORT/DATABASE, with the password in PGPASSWORD or ~/.pgpass."
        raise DataError(f"--to: invalid PostgreSQL address. {cure}")
    return f"{settings.get('host', '')}:{settings.get('port', 5432)}/{settings.get('dbname', '')}"


@contextmanager
def _connection(address: str, password: str, place: str) -> Iterator[Any]:
    """Open a connection; raise DataError for any failure of it."""
    import psycopg
    from psycopg.conninfo import conninfo_to_dict, make_conninfo

    given = conninfo_to_dict(address)
    missing = {name: value for name, value in CONNECTION_TIMEOUTS.items() if name not in given}
    watchful = make_conninfo(address, **missing, **({"password": password} if password else {}))
    try:
        with psycopg.connect(watchful, autocommit=True) as connection:
            connection.execute(f"SET lock_timeout = '{POSTGRES_LOCK_WAIT}s'")
            yield connection
    except psycopg.errors.LockNotAvailable:
        raise DataError(
            f"--to {place}: another export is writing to this database. Repeat the command later."
        ) from None
    except psycopg.Error as error:
        reason = str(error).partition("\n")[0]
        cure = "Repeat the command: written rows stay, and missing rows are added"
        raise DataError(join_sentences(f"--to {place}: {reason}", cure)) from None


def _make_table(connection: Any) -> bool:
    """Make the table if it is missing, and return whether it is a hypertable."""
    with connection.transaction(), connection.cursor() as cursor:
        cursor.execute(EXPORT_LOCK_QUERY)
        (is_new,) = cursor.execute("SELECT to_regclass(%s) IS NULL", [POSTGRES_TABLE]).fetchone()
        (has_timescale,) = cursor.execute(HAS_TIMESCALE).fetchone()
        if is_new:
            cursor.execute(CREATE_TABLE)
            if has_timescale:
                cursor.execute(CREATE_HYPERTABLE)
        return bool(has_timescale)


def _write_next(connection: Any, remaining: Iterator[TapTestTable]) -> tuple[int, int, int] | None:
    """Read the next machines and write them; None where none are left.

    Return the numbers of tap tests read, of rows added or changed, and of stored rows that no longer count.
    """
    batch, count = list[TapTestTable](), 0
    with connection.transaction(), connection.cursor() as cursor:
        cursor.execute(EXPORT_LOCK_QUERY)
        while count < POSTGRES_BATCH_TAPS and (table := next(remaining, None)) is not None:
            batch.append(table)
            count += len(table.tap_id)
        if not batch:
            return None
        cursor.execute(CREATE_INCOMING)
        with cursor.copy("COPY incoming FROM STDIN") as copy:
            for row in chain.from_iterable(map(_table_rows, batch)):
                copy.write_row(row)
        written = cursor.execute(UPSERT).rowcount
        set_aside = cursor.execute(MARK_EXCLUDED, [[table.folder for table in batch]]).rowcount
    return count, written, set_aside


def _table_rows(table: TapTestTable) -> Iterator[Sequence[Any]]:
    """Return rows in the order of the columns."""
    series = [(tool, direction, n) for n, (tool, direction) in enumerate(table.series, 1)]
    taps = zip(table.tap_id, table.time, table.series_numbers, table.numbers.tolist(), table.remarks, strict=True)
    for tap_id, time, number, numbers, remarks in taps:
        yield (table.folder, table.machine, tap_id, time, *series[number - 1], *numbers, remarks)
