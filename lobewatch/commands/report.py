"""Command `lobewatch report`: write an HTML report."""

from datetime import datetime
from pathlib import Path
from typing import Annotated

from typer import Option

from lobewatch.commands.shared_options import FolderArgument, Now
from lobewatch.show.terminal.option_names import with_option_names
from lobewatch.show.terminal.output import Json, emit, print_remarks
from lobewatch.step_times import time_step


def report(
    machine: Annotated[Path, FolderArgument(help="Machine folder, or a folder of machine folders.")],
    out: Annotated[Path | None, Option(help="HTML file. Default: report.html in the folder.")] = None,
    tool: Annotated[str, Option(help="Tool of the series. Default: tool of the worst series.")] = "",
    direction: Annotated[str, Option(help="Direction of the series: x or y. Default: that of the worst series.")] = "",
    now: Now = None,
    as_json: Json = False,
) -> None:
    """Write the report of a machine or of a folder of machines.

    The report of a folder of machines has one line per machine, worst first.

    Examples
    --------
      lobewatch report trial
      lobewatch report trial --out spindle.html --tool reference --direction x
    """
    from lobewatch.logbook import Logbook
    from lobewatch.show.report.report import write_report

    if not (machine / "machine.toml").is_file() and any(machine.glob("*/machine.toml")):
        if tool or direction:
            raise ValueError(f"--tool and --direction need one machine. Name a machine folder in {machine}.")
        path = _write_for_fleet(machine, out, now or datetime.now().astimezone())
    else:
        logbook = Logbook.open(machine, now)
        with time_step("report"):
            path = write_report(logbook, out, tool, direction)
        print_remarks(logbook.remarks)
    emit({"report": str(path)}, as_json, f"report: {path}")


def _write_for_fleet(folder: Path, out: Path | None, now: datetime) -> Path:
    from lobewatch.fleet.fleet import Fleet, find_machines
    from lobewatch.show.fleet.fleet_status import fleet_rows
    from lobewatch.show.report.report import write_fleet_report

    rows = fleet_rows(Fleet(find_machines(folder), with_option_names).assess_machines(now))
    return write_fleet_report(rows, folder, out, now)
