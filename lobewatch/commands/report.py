"""lobewatch report."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from acquisition import DataError, atomic_write
from lobewatch.analysis.history import update_history
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.named_folder import named_folder
from lobewatch.show.output import Json, emit
from lobewatch.show.report import render_report


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
    folder = MachineFolder(machine)
    path = write_report(folder, out or folder.path / "report.html", tool, direction)
    emit({"report": str(path)}, as_json, f"report: {path}")


def write_report(folder: MachineFolder, path: Path, tool: str = "", direction: str = "") -> Path:
    """Bring the history up to date and write the report of one series; DataError without a tap test."""
    taps = folder.taps()
    if not taps:
        raise DataError(f"{folder.path}: no tap test yet; take one with lobewatch tap, or replay a recorded file")
    with folder.locked():
        history, _ = update_history(folder)
    html = render_report(folder, history, tool or taps[-1].tool, direction or taps[-1].direction)
    atomic_write(path, html.encode())
    return path
