"""lobewatch check."""

from __future__ import annotations

from pathlib import Path
from time import monotonic
from typing import Annotated

import typer

from lobewatch.machine.folder_path import named_folder
from lobewatch.show.terminal.output import Json, emit, notes

PATIENCE = 5.0
"""Time after which a person is told how far it is (s)."""


def check(
    machine: Annotated[
        Path, typer.Argument(parser=named_folder, help="Machine folder with tap tests and cutting programs.")
    ],
    as_json: Json = False,
) -> None:
    """Every cutting program against the newest tap tests of its tool; exit code 1 unless all are stable.

    By semi-discretisation, over all that is not known: stable, doubtful, not stable or unknown. Says for each that is
    not stable what decides and where to go. f_n left: how far f_n may fall before the program chatters.

    Examples:

      lobewatch check trial
      lobewatch check trial --json
    """
    from acquisition import DataError
    from lobewatch.logbook import Logbook
    from lobewatch.show.programs.describe_advice import ProgramAdvice, advise_program, check_json, check_texts
    from lobewatch.show.programs.describe_verdicts import is_safe

    logbook = Logbook.open(machine)
    if not logbook.machine.program:
        raise DataError(f"{logbook.folder.toml}: no [[program]] to check; add one for each cut that the shop runs")
    logbook.newest()
    begin, slow, programs = monotonic(), False, list[ProgramAdvice]()
    for verdict in logbook.verdicts():
        if not slow and monotonic() - begin > PATIENCE:
            count = len(logbook.machine.program)
            notes.print(f"{len(programs)} of {count} programs are checked; the others take a while too")
            slow = True
        programs.append(advise_program(logbook, verdict))
    remarks = logbook.remarks
    emit(check_json(programs, remarks), as_json, *check_texts(programs, remarks, logbook.machine))
    if not all(is_safe(advice.verdict) for advice in programs):
        raise typer.Exit(1)
