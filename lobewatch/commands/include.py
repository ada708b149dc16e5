"""Command `lobewatch include`: include an excluded tap test again."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lobewatch.machine.folder_files import to_folder_path
from lobewatch.show.terminal.output import Json, emit


def include(
    machine: Annotated[Path, typer.Argument(parser=to_folder_path, help="Machine folder.")],
    tap: Annotated[
        str,
        typer.Argument(help="The tap test: its identity, its file, or a part that no other has; or a test cut, c1."),
    ],
    as_json: Json = False,
) -> None:
    """Include an excluded tap test or test cut again.

    Examples
    --------
      lobewatch include mill-3 20261102T0914
    """
    from lobewatch.logbook import Logbook
    from lobewatch.machine.folder_updates import include_entry as take_back
    from lobewatch.notify.publish_status import publish_on_change

    logbook = Logbook.open(machine)
    with publish_on_change(logbook):
        entry = take_back(logbook.folder, tap)
        emit({"included": entry.id}, as_json, f"included {entry.id}: it counts again")
