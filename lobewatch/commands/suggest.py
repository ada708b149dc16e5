"""Command `lobewatch suggest`: suggest the next test cut."""

from typing import Annotated

from typer import Option

from lobewatch.commands.shared_options import Machine, Now
from lobewatch.show.terminal.output import Json, emit


def suggest(
    machine: Machine,
    program: Annotated[str, Option(help="Program name.")],
    cuts: Annotated[int, Option(min=1, help="Total number of test cuts.")] = 5,
    now: Now = None,
    as_json: Json = False,
) -> None:
    """Suggest the next test cut of a program.

    Earlier test cuts (lobewatch observe, lobewatch listen) update the values of the rotating spindle and of
    the cutting force. The result shows the values before and after the test cuts. Without a tap test of the tool, the
    chatter frequencies of the cuts give the next speeds.

    Examples
    --------
      lobewatch suggest mill-3 --program A
      lobewatch suggest mill-3 --program A --cuts 8 --json
    """
    from acquisition import DataError
    from lobewatch.cuts.learning.pocket_depth import choose_first_depth, find_pocket_depths
    from lobewatch.cuts.learning.program_learning import find_next_cut, find_program
    from lobewatch.logbook import Analysis, Logbook
    from lobewatch.logbook.heard_cuts import suggest_by_sound
    from lobewatch.machine.settings.requested_cut import find_cut_setting
    from lobewatch.show.cuts import next_speeds as sound
    from lobewatch.show.cuts import suggested_cuts as show
    from lobewatch.show.terminal.output import remark_lines

    logbook = Logbook.open(machine, now)
    table = find_program(logbook.machine, program)
    assembly = logbook.query(Analysis.assembly_or_reason, table.tool)
    if isinstance(assembly, DataError):
        setting = find_cut_setting(logbook.machine, table.name, None, None)
        found = suggest_by_sound(logbook, setting, logbook.cuts)
        remarks = logbook.remarks
        texts = [*sound.untapped_texts(setting, found, logbook.folder.path), *remark_lines(remarks)]
        emit(sound.untapped_json(setting, found) | {"remarks": remarks}, as_json, *texts)
        return
    if assembly.without_stiffness and not assembly.directions:
        depths, first = find_pocket_depths(table, assembly, logbook.machine, logbook.cuts), choose_first_depth(table)
        remarks = [*logbook.remarks, *assembly.remarks]
        payload = show.tried_depths_json(table, depths, first) | {"remarks": remarks}
        pockets = show.speed_pocket_table([heard.pocket for heard in depths])
        lines = show.tried_depths_lines(table, depths, first, logbook.folder.path)
        emit(payload, as_json, pockets, *lines, *remark_lines(remarks))
        return
    assembly = assembly.check()
    suggestion = find_next_cut(table, assembly, logbook.machine, logbook.cuts, cuts)
    remarks = [*logbook.remarks, *assembly.remarks, *show.learned_remarks(suggestion.learning)]
    texts = [*show.suggestion_lines(suggestion, logbook.folder.path), *show.learned_texts(suggestion.learning)]
    emit(show.suggestion_json(suggestion) | {"remarks": remarks}, as_json, *texts, *remark_lines(remarks))
