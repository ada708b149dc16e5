"""Command `lobewatch doctor`: check the computer for a tap test."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lobewatch.machine.folder_files import to_folder_path
from lobewatch.show.terminal.output import Json, emit


def doctor(
    machine: Annotated[Path | None, typer.Argument(parser=to_folder_path, help="Machine folder.")] = None,
    as_json: Json = False,
) -> None:
    """Examine this computer for tap tests.

    With a machine its port, its driver and its folder are looked at, too. Exit code 1 where something hinders.

    Examples
    --------
      lobewatch doctor
      lobewatch doctor mill-3 --json
    """
    from lobewatch.machine.folder import MachineFolder
    from lobewatch.sensors.computer_check import check_computer
    from lobewatch.show.sensors import findings_json, findings_texts

    findings = check_computer(MachineFolder(machine) if machine else None)
    emit(findings_json(findings), as_json, *findings_texts(findings))
    if any(finding.state == "hinders" for finding in findings):
        raise typer.Exit(1)
