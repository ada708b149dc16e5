"""Command `lobewatch observe`: record the result of a test cut by ear, or the power of a cut."""

from typing import Annotated

from typer import Option

from lobewatch.commands.shared_options import CutDate, CutDepth, CutPower, Machine, number, rpm
from lobewatch.show.terminal.output import Json, emit, print_remarks


def observe(
    machine: Machine,
    program: Annotated[str, Option(help='Program name, or "reference cut".')],
    speed: Annotated[float | None, Option(parser=rpm, help="Spindle speed (rpm). Default: from the program.")] = None,
    depth: CutDepth = None,
    stable: Annotated[bool, Option("--stable", help="The cut was stable.")] = False,
    chatter: Annotated[bool, Option("--chatter", help="The cut chattered.")] = False,
    frequency: Annotated[float | None, Option(parser=number, help="Chatter frequency (Hz), if known.")] = None,
    power: CutPower = None,
    date: CutDate = None,
    as_json: Json = False,
) -> None:
    """Store whether a cut sounded stable, its power, or both. lobewatch exclude takes it out of all results.

    Examples
    --------
      lobewatch observe mill-3 --program A --speed 12000 --depth 2 --stable
      lobewatch observe mill-3 --program A --speed 12000 --depth 3 --chatter --frequency 1650
      lobewatch observe mill-3 --program A --speed 12000 --depth 2 --stable --power 1.4
      lobewatch observe mill-3 --program A --power 1.4
    """
    from lobewatch.logbook import Logbook
    from lobewatch.logbook.production import plan_next_cut
    from lobewatch.machine.folder_updates import choose_word, make_observed_cut, store_cut
    from lobewatch.machine.settings.requested_cut import find_cut_setting
    from lobewatch.notify.publish_status import publish_on_change
    from lobewatch.show.cuts.production_steps import next_step_json, next_step_lines
    from lobewatch.show.history import cut_json, cut_text, saved_cut_remarks

    word, logbook = choose_word(stable, chatter, power), Logbook.open(machine)
    heard = make_observed_cut(find_cut_setting(logbook.machine, program, speed, depth, power), word, frequency, date)
    with publish_on_change(logbook):
        earlier, stored = logbook.cuts, store_cut(logbook.folder, heard)
        plan = plan_next_cut(logbook, stored.program, [*earlier, stored])
        remarks = saved_cut_remarks(logbook, stored, earlier)
        payload = {"cut": cut_json(stored), "remarks": [remark.code for remark in remarks]} | next_step_json(plan)
        emit(payload, as_json, f"saved {cut_text(stored)}", *next_step_lines(plan, logbook.folder.path))
    print_remarks(remarks)
