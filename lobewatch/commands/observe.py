"""Command `lobewatch observe`: record the result of a test cut by ear."""

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
    """Store whether a test cut sounded stable.

    The result is stored in the journal. lobewatch exclude takes the cut out of all results.

    Examples
    --------
      lobewatch observe mill-3 --program A --speed 12000 --depth 2 --stable
      lobewatch observe mill-3 --program A --speed 12000 --depth 3 --chatter --frequency 1650
      lobewatch observe mill-3 --program A --speed 12000 --depth 2 --stable --power 1.4
    """
    from lobewatch.logbook import Logbook
    from lobewatch.machine.folder_updates import find_contradicting_cuts, make_observed_cut, store_cut
    from lobewatch.machine.settings.requested_cut import find_cut_setting
    from lobewatch.notify.publish_status import publish_on_change
    from lobewatch.show.history import contradiction_remark, cut_json, cut_text, untapped_remarks

    if stable == chatter:
        raise ValueError(
            f"{'both' if stable else 'neither'} of --stable and --chatter. Give exactly one of the two options."
        )
    logbook = Logbook.open(machine)
    setting = find_cut_setting(logbook.machine, program, speed, depth, power)
    heard = make_observed_cut(setting, "stable" if stable else "chatter", frequency, date)
    contradicting = find_contradicting_cuts(heard, logbook.cuts)
    remarks = [*untapped_remarks(logbook, heard), *map(contradiction_remark, contradicting)]
    with publish_on_change(logbook):
        stored = store_cut(logbook.folder, heard)
        payload = {"cut": cut_json(stored), "remarks": [remark.code for remark in remarks]}
        emit(payload, as_json, f"saved {cut_text(stored)}")
    print_remarks(remarks)
