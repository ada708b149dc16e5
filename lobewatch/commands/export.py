"""lobewatch export."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lobewatch.machine.folder_path import named_folder
from lobewatch.show.terminal.output import Json, emit, notes


def export(
    folder: Annotated[
        Path, typer.Argument(parser=named_folder, help="Machine folder, or a folder of machine folders.")
    ],
    file: Annotated[Path, typer.Argument(help="What to write: its ending is .sqlite, .csv, .csv.gz or .parquet.")],
    as_json: Json = False,
) -> None:
    """All tap tests of all machines as one table, a line each, for other programs: SQLite, CSV, Parquet.

    The same again gives the same bytes. Excluded tap tests are left out. One that cannot be read is named, and the
    exit code is 2. Parquet is written by DuckDB (pip install "lobewatch[fleet]").

    Examples:

      lobewatch export mills fleet.sqlite
      lobewatch export mills fleet.csv
    """
    from lobewatch.plant.plant import find_machines
    from lobewatch.plant.tap_table import all_tables
    from lobewatch.show.plant.table_files import write_table

    machines, damaged = find_machines(folder), dict[str, str]()
    count = write_table(all_tables(machines, damaged), file)
    for key, reason in damaged.items():
        notes.print(f"left out {key}: {reason}", markup=False)
    payload = {"file": str(file), "machines": len(machines) - len(damaged), "tap_tests": count, "left_out": damaged}
    emit(payload, as_json, f"{count} tap tests of {len(machines) - len(damaged)} machines in {file}")
    raise typer.Exit(2 if damaged else 0)
