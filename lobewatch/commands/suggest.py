"""lobewatch suggest."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lobewatch.machine.folder_path import named_folder
from lobewatch.show.terminal.output import Json, emit


def suggest(
    machine: Annotated[Path, typer.Argument(parser=named_folder, help="Machine folder with at least one tap test.")],
    program: Annotated[str, typer.Option(help="Cutting program to find the limits of.")],
    cuts: Annotated[int, typer.Option(min=1, help="Test cuts that shall be made in all.")] = 5,
    as_json: Json = False,
) -> None:
    """The next test cut of a program: the one worth most, of those that are more likely stable than not.

    Cuts that were heard (lobewatch observe) say what the spindle is like when it turns, and how hard the material is
    to cut. Says what was learnt of both, beside what was known before.

    Examples:

      lobewatch suggest mill-3 --program A
      lobewatch suggest mill-3 --program A --cuts 8 --json
    """
    from lobewatch.cuts.learning.heard_depth import first_depth, heard_depths
    from lobewatch.cuts.learning.lesson import find_program, next_cut
    from lobewatch.logbook import Logbook
    from lobewatch.show.cuts.describe_heard import heard_json, heard_lines, speed_table
    from lobewatch.show.cuts.describe_suggestion import learnt_texts, lesson_remarks, suggestion_json, suggestion_lines
    from lobewatch.show.terminal.output import remark_json, remark_lines

    logbook = Logbook.open(machine)
    table = find_program(logbook.machine, program)
    assembly = logbook.assembly(table.tool)
    if assembly.unweighed and not assembly.directions:
        depths, first = heard_depths(table, assembly, logbook.machine, logbook.cuts), first_depth(table)
        remarks = [*logbook.remarks, *assembly.remarks]
        payload = heard_json(table, depths, first) | {"remarks": [remark_json(remark) for remark in remarks]}
        lines = heard_lines(table, depths, first, logbook.folder.path)
        emit(payload, as_json, speed_table([heard.pocket for heard in depths]), *lines, *remark_lines(remarks))
        return
    assembly = assembly.checked()
    suggestion = next_cut(table, assembly, logbook.machine, logbook.cuts, cuts)
    remarks = [*logbook.remarks, *assembly.remarks, *lesson_remarks(suggestion.lesson)]
    emit(
        suggestion_json(suggestion) | {"remarks": [remark_json(remark) for remark in remarks]},
        as_json,
        *suggestion_lines(suggestion, logbook.folder.path),
        *learnt_texts(suggestion.lesson),
        *remark_lines(remarks),
    )
