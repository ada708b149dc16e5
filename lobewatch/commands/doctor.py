"""Command `lobewatch doctor`: check the computer for a tap test."""

from pathlib import Path
from typing import Annotated

from typer import Exit

from lobewatch.commands.shared_options import FolderArgument, open_folder
from lobewatch.show.terminal.output import Json, emit


def doctor(
    machine: Annotated[Path | None, FolderArgument(help="Machine folder to check with the computer.")] = None,
    as_json: Json = False,
) -> None:
    """Examine this computer for tap tests.

    Exit code 1: something prevents a tap test.

    Examples
    --------
      lobewatch doctor
      lobewatch doctor mill-3 --json
    """
    from lobewatch.foreign_packages import FOREIGN_PACKAGE_CURE, describe_foreign_packages

    if foreign := describe_foreign_packages():  # nothing else can be examined
        finding = {"subject": "foreign packages", "state": "hinders", "text": foreign, "cure": FOREIGN_PACKAGE_CURE}
        emit({"findings": [finding], "hinder": 1}, as_json, f"✗ {foreign}. {FOREIGN_PACKAGE_CURE}.")
        raise Exit(1)
    from lobewatch.sensors.computer_check import check_computer
    from lobewatch.show.sensors import findings_json, findings_texts

    findings = check_computer(open_folder(machine) if machine else None)
    emit(findings_json(findings), as_json, *findings_texts(findings))
    raise Exit(int(any(finding.state == "hinders" for finding in findings)))
