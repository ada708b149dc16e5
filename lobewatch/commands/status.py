"""Command `lobewatch status`: status of all machines, worst first."""

from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Exit, Option

from lobewatch.commands.shared_options import AsCsv, FleetFolder, Now
from lobewatch.show.terminal.option_names import with_option_names
from lobewatch.show.terminal.output import Json, emit, results

if TYPE_CHECKING:
    from lobewatch.fleet.fleet import Fleet

DASHBOARD_ONLY_KEYS = ("points", "limits", "limit", "word", "change", "finding")
"""Keys that only the text and the dashboard show."""


def status(
    folder: FleetFolder,
    due: Annotated[bool, Option("--due", help="Only machines whose tap test is due.")] = False,
    to_notify: Annotated[
        bool, Option("--notify", help="Publish the status by MQTT to the brokers in [notify] of machine.toml.")
    ] = False,
    forget: Annotated[str, Option(help="Machine whose messages --notify removes from its broker.")] = "",
    prometheus: Annotated[Path | None, Option(help="File for the textfile collector of Prometheus.")] = None,
    jobs: Annotated[int, Option(min=1, max=64, help="Number of parallel processes.")] = 1,
    scheduler: Annotated[str, Option(help="Address of a Dask scheduler whose workers can read FOLDER.")] = "",
    now: Now = None,
    as_csv: AsCsv = False,
    as_json: Json = False,
) -> None:
    """Show the status of all machines in a folder.

    Exit code 1: a machine is on alarm or cannot be evaluated. Exit code 2: --notify could not reach a broker.

    Examples
    --------
      lobewatch status mills
      lobewatch status mills --due
    """
    from lobewatch.fleet.fleet import Fleet, find_machines
    from lobewatch.monitoring.status_rules import StatusLevel
    from lobewatch.show.fleet.fleet_status import fleet_csv, fleet_rows, fleet_text
    from lobewatch.show.terminal.status_labels import status_name

    if as_csv and as_json:
        raise ValueError("--csv cannot be used with --json. Leave out one of the two options.")
    if forget and not to_notify:
        raise ValueError(f"--forget {forget} needs --notify. Add --notify.")
    fleet = Fleet(find_machines(folder), with_option_names)
    if jobs > 1 or scheduler:
        _make_missing_summaries(fleet, jobs, scheduler, now)
    assessed = fleet.assess_machines(now)
    rows = fleet_rows(assessed)
    shown = [row for row in rows if not due or row["days_left"] is None or row["days_left"] < 0]
    if as_csv:
        results.out(fleet_csv(shown), end="", highlight=False)
    else:
        levels = [row["light"] for row in rows]
        counted = ", ".join(f"{levels.count(level)} {status_name(level)}" for level in StatusLevel if level in levels)
        count = f"{len(rows)} machine{'s' if len(rows) > 1 else ''}: {counted}"
        machine_rows = [{key: row[key] for key in row if key not in DASHBOARD_ONLY_KEYS} for row in shown]
        emit({"machines": machine_rows}, as_json, "" if as_json else fleet_text(shown), count)
    if prometheus is not None:
        from acquisition.file_io import atomic_write
        from lobewatch.notify.prometheus import format_prometheus

        atomic_write(prometheus, format_prometheus(assessed).encode())
    failures = 0
    if to_notify:
        from lobewatch.notify.publish_status import publish_folder

        failures = len(publish_folder(folder, assessed, forget))
    needs_care = any(row["light"] is StatusLevel.ALARM or not row["can_be_judged"] for row in rows)
    raise Exit(1 if needs_care else 2 * (failures > 0))


def _make_missing_summaries(fleet: "Fleet", jobs: int, scheduler: str, now: datetime | None) -> None:
    """Make missing summaries in other processes."""
    from functools import partial

    from lobewatch.fleet.summarize import summarize_in_parallel
    from lobewatch.measurement.share_work import Workers
    from lobewatch.show.terminal.output import print_remarks

    workers = Workers(jobs, scheduler)
    print_remarks(workers.remarks)
    make = partial(summarize_in_parallel, workers=workers, render_text=with_option_names)
    fleet.make_missing_summaries(make, now)
