"""Verdicts on those programs of a machine that are asked about, or on a cut that is none of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from acquisition import DataError
from lobewatch.logbook.logbook import Logbook
from lobewatch.logbook.recommended import recommended_program
from lobewatch.machine.settings.asked_cut import asked_program
from lobewatch.machine.settings.cut_setting import find_named
from lobewatch.verdicts.recommendation import Recommendation
from lobewatch.verdicts.verdict import Verdict


class Chosen(NamedTuple):
    """Answers to what was asked about."""

    verdicts: list[Verdict]
    """Verdicts on the programs that have a speed and a depth."""
    recommendations: list[Recommendation]
    """Settings of those that have not."""


def chosen_verdicts(logbook: Logbook, names: Sequence[str], said: Mapping[str, Any]) -> Chosen:
    """Of the cut that is said (see `asked_program`), else of the programs of these names, else of all.

    ValueError for a name or a cut that is none, DataError where there is no program or no tap test.
    """
    machine = logbook.machine
    if any(value is not None for value in said.values()):
        if names:
            raise ValueError("--program has its own speed, depth and tool; give either it or the options of a cut")
        asked = asked_program(machine, said)
        logbook.newest()
        return Chosen([logbook.verdict_on(asked)], [])
    if not machine.listed:
        add = "add one for each cut that the shop runs, or give --speed, --depth, --tool and --material"
        raise DataError(f"{logbook.folder.toml}: no [[program]] to check; {add}")
    by_name = {table.name: table for table in machine.listed}
    chosen = [find_named(by_name, name).name for name in names] or list(by_name)
    logbook.newest()
    wanted = [table for table in machine.open_programs if table.name in chosen]
    is_judged = any(table.name in chosen for table in machine.program)
    verdicts = logbook.verdicts(names=chosen if names else None) if is_judged else []
    return Chosen(verdicts, [recommended_program(logbook, table) for table in wanted])
