"""lobewatch rebuild."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lobewatch.machine.folder_path import named_folder
from lobewatch.show.terminal.output import Json


def rebuild(
    machine: Annotated[
        Path, typer.Argument(parser=named_folder, help="Machine folder, or a folder of machine folders.")
    ],
    jobs: Annotated[
        int, typer.Option(min=1, max=64, help="Processes that work at once; what they find is the same.")
    ] = 1,
    scheduler: Annotated[
        str, typer.Option(help="Address of a Dask scheduler whose workers work, such as tcp://10.0.0.5:8786.")
    ] = "",
    as_json: Json = False,
) -> None:
    """The history anew from the tap tests, and the journal where that is damaged; nothing is deleted.

    What is damaged is put into a folder named damaged. Tap files that were renamed or swapped get their names back,
    whole ones that are in no journal are entered. A tap test whose file is lost is gone on without; put back from a
    backup, it counts again. Of a folder of machines each is rebuilt; one that cannot be costs only itself.

    Examples:

      lobewatch rebuild mill-3
      lobewatch rebuild mills --scheduler tcp://10.0.0.5:8786
    """
    from lobewatch.measuring.workers.share_work import Workers
    from lobewatch.notify.telling import tell
    from lobewatch.show.replays.show_rebuild import show_rebuild

    show_rebuild(machine, Workers(jobs, scheduler), tell, as_json=as_json)
