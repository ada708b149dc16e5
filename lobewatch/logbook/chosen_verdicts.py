"""Verdicts on those programs of a machine that are asked about, or on a cut that is none of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from acquisition import DataError
from lobewatch.cuts.learning.lesson import find_program
from lobewatch.logbook.logbook import Logbook
from lobewatch.machine.settings.asked_cut import asked_program
from lobewatch.verdicts.verdict import Verdict


def chosen_verdicts(logbook: Logbook, names: Sequence[str], said: Mapping[str, Any]) -> list[Verdict]:
    """Of the cut that is said (see `asked_program`), else of the programs of these names, else of all.

    ValueError for a name or a cut that is none, DataError where there is no program or no tap test.
    """
    machine = logbook.machine
    if any(value is not None for value in said.values()):
        if names:
            raise ValueError("--program has its own speed, depth and tool; give either it or the options of a cut")
        asked = asked_program(machine, said)
        logbook.newest()
        return [logbook.verdict_on(asked)]
    if not machine.program:
        add = "add one for each cut that the shop runs, or give --speed, --depth, --tool and --material"
        raise DataError(f"{logbook.folder.toml}: no [[program]] to check; {add}")
    chosen = [find_program(machine, name).name for name in names]
    logbook.newest()
    return logbook.verdicts(names=chosen or None)
