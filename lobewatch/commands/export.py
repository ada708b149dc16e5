"""Command `lobewatch export`: export the tap tests of all machines."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Exit, Option

from lobewatch.commands.shared_options import FleetFolder
from lobewatch.show.terminal.option_names import with_option_names
from lobewatch.show.terminal.output import Json, emit, print_always


def export(
    folder: FleetFolder,
    file: Annotated[Path | None, Argument(help="Output file: .sqlite, .csv, .csv.gz or .parquet.")] = None,
    append: Annotated[
        Path | None,
        Option(help="Folder of monthly Parquet files, to which new rows are added."),
    ] = None,
    to: Annotated[
        str | None,
        Option(help="Database to update: postgresql://HOST/NAME."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Export the tap tests of all machines as one table.

    Excluded tap tests are left out. Parquet needs pip install "lobewatch[fleet]". PostgreSQL needs pip install
    "lobewatch[postgres]", and a password in PGPASSWORD or ~/.pgpass.

    Exit code 2: a machine is unreadable and left out.

    Examples
    --------
      lobewatch export mills fleet.sqlite
      lobewatch export mills --append fleet
      lobewatch export mills --to postgresql://mills@db.example/plant
    """
    from acquisition.credentials import restore_password
    from lobewatch.fleet.fleet import find_machines
    from lobewatch.fleet.tap_table import read_all_tables
    from lobewatch.show.fleet.export_files import append_months, write_table
    from lobewatch.show.fleet.export_postgres import upsert_table

    if [file, append, to].count(None) != 2:
        raise ValueError("Give exactly one of FILE, --append FOLDER and --to ADDRESS.")
    machines, damaged = find_machines(folder), dict[str, str]()
    tables = read_all_tables(machines, damaged, with_option_names)
    if file is not None:
        outcome = write_table(tables, file)
    elif append is not None:
        outcome = append_months(tables, append)
    else:
        outcome = upsert_table(tables, restore_password(str(to)))
    for key, reason in damaged.items():
        print_always(f"machine left out: {key}: {reason}")
    n_machines, (place, *_) = len(machines) - len(damaged), outcome.fields.values()
    payload = {"machines": n_machines, "tap_tests": outcome.tap_tests, "left_out": damaged}
    text = f"{outcome.tap_tests} tap tests of {n_machines} machines in {place}"
    emit({**outcome.fields, **payload}, as_json, text, *outcome.sentences)
    raise Exit(2 if damaged else 0)
