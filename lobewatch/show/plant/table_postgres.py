"""Tap tests of all machines as a table of PostgreSQL that follows them (extra `postgres`)."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from itertools import chain
from typing import Any, NamedTuple

from acquisition import DataError
from lobewatch.plant.tap_table import NUMBERS, TapTable
from lobewatch.show.plant.export_outcome import ExportOutcome
from lobewatch.show.plant.table_columns import COLUMNS

TABLE = "lobewatch_taps"
BATCH = 20_000
"""Tap tests from which on what was read is written in one transaction; chosen."""
PATIENCE = 60
"""Time for which another export is waited for (s); chosen."""
SILENCE = {"connect_timeout": 10, "keepalives_idle": 10, "keepalives_interval": 5, "keepalives_count": 4}
"""Settings (s) by which a server that is gone without a word is told; those in the address come first; chosen."""
KEY = ("folder", "tap_id", "time")
"""Columns by which a line is known; with the time, as a hypertable wants it."""
TYPES = dict.fromkeys(NUMBERS, "double precision") | {"time": "timestamptz", "series": "integer"}
FIELDS = ", ".join(f"{name} {TYPES.get(name, 'text')}" for name in COLUMNS)
CREATE = f"""
CREATE TABLE IF NOT EXISTS {TABLE} ({FIELDS}, counts boolean NOT NULL, PRIMARY KEY ({", ".join(KEY)}))
"""
HYPERTABLE = f"SELECT create_hypertable('{TABLE}', 'time', chunk_time_interval => INTERVAL '1 month')"
INCOMING = f"CREATE TEMPORARY TABLE incoming ({FIELDS.replace('timestamptz', 'double precision')}) ON COMMIT DROP"
"""Lines as they are sent, the time in seconds since 1970."""
VALUES = ", ".join(
    "to_timestamp(time)" if n == "time" else f"nullif({n}, 'NaN')" if n in NUMBERS else n for n in COLUMNS
)
CHANGING = [name for name in (*COLUMNS, "counts") if name not in KEY]
UPSERT = f"""
INSERT INTO {TABLE} SELECT {VALUES}, true FROM incoming
ON CONFLICT ({", ".join(KEY)}) DO UPDATE SET {", ".join(f"{name} = excluded.{name}" for name in CHANGING)}
WHERE ({", ".join(f"{TABLE}.{name}" for name in CHANGING)})
  IS DISTINCT FROM ({", ".join(f"excluded.{name}" for name in CHANGING)})
"""
SET_ASIDE = f"""
UPDATE {TABLE} SET counts = false WHERE counts AND folder = ANY(%s)
  AND NOT EXISTS (SELECT FROM incoming WHERE (incoming.folder, incoming.tap_id) = ({TABLE}.folder, {TABLE}.tap_id))
"""


SCHEMES = ("postgresql://", "postgres://")
LOCK = f"SELECT pg_advisory_xact_lock(hashtext('{TABLE}'))"
HAS_TIMESCALE = "SELECT EXISTS (SELECT FROM pg_proc WHERE proname = 'create_hypertable')"
QUIET = logging.getLogger("psycopg")
"""Log of what a lost connection cannot do any more; the error says it."""
QUIET.addHandler(logging.NullHandler())
QUIET.propagate = False


class _Counts(NamedTuple):
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
    total = _Counts(0, 0, 0)
    with _connection(address, place) as connection:
        is_hypertable = _make_table(connection)
        while (counts := _write_next(connection, remaining)) is not None:
            total = _Counts(*map(sum, zip(total, counts, strict=True)))
    kind = "a hypertable of TimescaleDB" if is_hypertable else "a plain table"
    sentences = [f"{TABLE} is {kind}; {total.written} of them written, the others stand there as they are"]
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
        settings = conninfo_to_dict(address) if address.startswith(SCHEMES) else {}
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
    watchful = make_conninfo(address, **{name: value for name, value in SILENCE.items() if name not in given})
    try:
        with psycopg.connect(watchful, autocommit=True) as connection:
            connection.execute(f"SET lock_timeout = '{PATIENCE}s'")
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
        cursor.execute(LOCK)
        (is_new,) = cursor.execute("SELECT to_regclass(%s) IS NULL", [TABLE]).fetchone()
        (has_timescale,) = cursor.execute(HAS_TIMESCALE).fetchone()
        if is_new:
            cursor.execute(CREATE)
            if has_timescale:
                cursor.execute(HYPERTABLE)
        return bool(has_timescale)


def _write_next(connection: Any, remaining: Iterator[TapTable]) -> _Counts | None:
    """Read some machines more, and write them; None where there are none."""
    with connection.transaction(), connection.cursor() as cursor:
        cursor.execute(LOCK)
        batch = _next_batch(remaining)
        if not batch:
            return None
        cursor.execute(INCOMING)
        with cursor.copy("COPY incoming FROM STDIN") as copy:
            for row in chain.from_iterable(map(_rows, batch)):
                copy.write_row(row)
        written = cursor.execute(UPSERT).rowcount
        set_aside = cursor.execute(SET_ASIDE, [[table.folder for table in batch]]).rowcount
    return _Counts(sum(len(table.tap_id) for table in batch), written, set_aside)


def _next_batch(remaining: Iterator[TapTable]) -> list[TapTable]:
    batch, count = list[TapTable](), 0
    while count < BATCH and (table := next(remaining, None)) is not None:
        batch.append(table)
        count += len(table.tap_id)
    return batch


def _rows(table: TapTable) -> Iterator[Sequence[Any]]:
    """Lines in the order of the columns."""
    series = [(tool, direction, n) for n, (tool, direction) in enumerate(table.series, 1)]
    taps = zip(table.tap_id, table.time, table.of_series, table.numbers.tolist(), table.remarks, strict=True)
    for tap_id, time, number, numbers, remarks in taps:
        yield (table.folder, table.machine, tap_id, time, *series[number - 1], *numbers, remarks)
