"""lobewatch history."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lobewatch.machine.named_folder import named_folder
from lobewatch.show.output import Json, emit, notes, results


def history(
    machine: Annotated[Path, typer.Argument(parser=named_folder, help="Machine folder.")],
    as_csv: Annotated[bool, typer.Option("--csv", help="A table with commas on stdout instead of text.")] = False,
    as_json: Json = False,
) -> None:
    """All tap tests of a machine with what they say, those excluded, and what was done to it, oldest first.

    Verdicts are those of the time after each test, where they were asked for; times are UTC in --csv and --json.

    Examples:

      lobewatch history mill-3
      lobewatch history mill-3 --csv
    """
    from lobewatch.analysis import Logbook
    from lobewatch.show.history.describe_history import history_csv, history_json, history_lines

    if as_csv and as_json:
        raise ValueError("--csv and --json: give one of them")
    logbook = Logbook.open(machine)
    if as_csv:
        results.out(history_csv(logbook), end="", highlight=False)
    else:
        emit(history_json(logbook), as_json, *history_lines(logbook))
    for remark in logbook.remarks:
        notes.print(f"note: {remark}", markup=False)
