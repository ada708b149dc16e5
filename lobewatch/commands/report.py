"""lobewatch report."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lobewatch.machine.named_folder import named_folder
from lobewatch.show.output import Json, emit, notes


def report(
    machine: Annotated[Path, typer.Argument(parser=named_folder, help="Machine folder with at least one tap test.")],
    out: Annotated[Path | None, typer.Option(help="The HTML file; MACHINE/report.html where not given.")] = None,
    tool: Annotated[str, typer.Option(help="The series of this tool; that of the newest test where not given.")] = "",
    direction: Annotated[str, typer.Option(help="x or y; that of the newest test where not given.")] = "",
    as_json: Json = False,
) -> None:
    """One HTML file with everything in it: what has changed, which programs still hold, lobes then and now.

    Examples:

      lobewatch report trial
      lobewatch report trial --out spindle.html --tool reference --direction x
    """
    from lobewatch.analysis import Logbook
    from lobewatch.show.report import write_report

    logbook = Logbook.open(machine)
    path = write_report(logbook, out, tool, direction)
    for remark in logbook.remarks:
        notes.print(f"note: {remark}", markup=False)
    emit({"report": str(path)}, as_json, f"report: {path}")
