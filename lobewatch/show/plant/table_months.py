"""Tap tests of all machines as a folder of Parquet files by month, to which later ones are added."""

from __future__ import annotations

import glob
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from acquisition.atomic import make_folder, sync_folder
from lobewatch.machine.folder_lock import FolderLock
from lobewatch.plant.tap_table import TapTable
from lobewatch.show.plant.export_outcome import ExportOutcome
from lobewatch.show.plant.table_columns import COLUMNS, table_lines, write_lines

PATIENCE = 60.0
"""Time for which another export into the folder is waited for (s); chosen."""
MISSING = """
CREATE TABLE missing AS SELECT strftime(time, '%Y-%m') AS month, * FROM lines ANTI JOIN present USING (folder, tap_id)
"""
OUTDATED = """
SELECT DISTINCT month FROM present LEFT JOIN lines USING (folder, tap_id)
WHERE folder IN (SELECT unnest(?::VARCHAR[])) AND (lines.time IS NULL OR {differ}) ORDER BY month
"""


def append_months(tables: Iterable[TapTable], folder: Path) -> ExportOutcome:
    """Add what is missing there, in `month=YYYY-MM/` (of the time in UTC), a file a month, each whole or not at all.

    A tap test is known by folder and tap_id. Files that are there are never altered. DataError without DuckDB, for a
    file there that is no such table, and where another export goes on for longer than PATIENCE.
    """
    tables = [*tables]
    with table_lines(tables, f"--append {folder}") as base:
        make_folder(folder)
        with FolderLock(folder).held(PATIENCE):
            for left in folder.glob("month=*/.*.tmp"):  # of an export that was killed
                left.unlink()
            _read_present(base, folder)
            base.execute(MISSING)
            months = base.execute("SELECT DISTINCT month FROM missing ORDER BY month").fetchall()
            added = sum(_write_month(base, folder, month) for (month,) in months)
        (count,) = base.execute("SELECT count(*) FROM lines").fetchone()
        outdated = _outdated(base, [table.folder for table in tables])
    sentences = [f"{added} of them are new there"]
    if outdated:
        months = ", ".join(f"month={month}" for month in outdated)
        sentences.append(
            f"{months}: some there were excluded or analysed anew since; to have them as they are now, delete "
            f"{'this folder' if len(outdated) == 1 else 'these folders'} and export again"
        )
    return ExportOutcome(count, {"folder": str(folder), "added": added, "outdated_months": outdated}, sentences)


def _read_present(base: Any, folder: Path) -> None:
    """The lines that are there as the table `present`."""
    base.execute("CREATE TABLE present AS SELECT *, '' AS month FROM lines LIMIT 0")
    files = [glob.escape(str(file)) for file in sorted(folder.glob("month=*/*.parquet"))]
    if files:
        read = "read_parquet(?, hive_partitioning = true, hive_types_autocast = false, union_by_name = true)"
        base.execute(f"INSERT INTO present BY NAME SELECT {', '.join(COLUMNS)}, month FROM {read}", [files])


def _write_month(base: Any, folder: Path, month: str) -> int:
    """Add a file whose name follows from the tap tests in it, so that the same are never there under two names."""
    lines = f"SELECT * EXCLUDE (month) FROM missing WHERE month = '{month}' ORDER BY folder, time, tap_id"
    keys = f"SELECT md5(string_agg(folder || chr(10) || tap_id, chr(10))) FROM ({lines})"
    name = f"{base.execute(keys).fetchone()[0]}.parquet"
    place = folder / f"month={month}"
    make_folder(place)
    temporary = place / f".{name}.tmp"
    try:
        count = write_lines(base, lines, temporary)
        with temporary.open("rb") as file:
            os.fsync(file.fileno())
        temporary.replace(place / name)
    finally:
        temporary.unlink(missing_ok=True)
    sync_folder(place)
    return count


def _outdated(base: Any, folders: list[str]) -> list[str]:
    differ = " OR ".join(f"present.{name} IS DISTINCT FROM lines.{name}" for name in COLUMNS[3:])
    return [month for (month,) in base.execute(OUTDATED.format(differ=differ), [folders]).fetchall()]
