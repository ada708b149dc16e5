"""lobewatch observe."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import Annotated

import typer

from lobewatch.machine.folder_path import named_folder
from lobewatch.show.terminal.output import Json, emit, note_remarks


def observe(
    machine: Annotated[Path, typer.Argument(parser=named_folder, help="Machine folder.")],
    program: Annotated[str, typer.Option(help='Cutting program that was cut, or "reference cut".')],
    speed: Annotated[
        float | None, typer.Option(help="Spindle speed, rpm; that of the program where not given.")
    ] = None,
    depth: Annotated[float | None, typer.Option(help="Axial depth, mm; that of the program where not given.")] = None,
    stable: Annotated[bool, typer.Option("--stable", help="It ran quietly.")] = False,
    chatter: Annotated[bool, typer.Option("--chatter", help="It chattered.")] = False,
    frequency: Annotated[float | None, typer.Option(help="What it chattered at, Hz, where somebody knows.")] = None,
    power: Annotated[
        float | None,
        typer.Option(help="Power of the cut, kW: what the drive shows, less what it shows in air at the same speed."),
    ] = None,
    date: Annotated[datetime | None, typer.Option(help="When it was cut, local time; now where not given.")] = None,
    as_json: Json = False,
) -> None:
    """Write down what was heard of a test cut by ear: that it was stable, or that it chattered.

    It is a line of the journal; lobewatch exclude takes it out again.

    Examples:

      lobewatch observe mill-3 --program A --speed 12000 --depth 2 --stable
      lobewatch observe mill-3 --program A --speed 12000 --depth 3 --chatter --frequency 1650
      lobewatch observe mill-3 --program A --speed 12000 --depth 2 --stable --power 1.4
    """
    from lobewatch.logbook import Logbook
    from lobewatch.machine.additions.keep_cut import keep_cut
    from lobewatch.machine.additions.observe_cut import contradicting_cuts, observe_cut
    from lobewatch.machine.settings.cut_setting import cut_setting
    from lobewatch.notify.telling import telling
    from lobewatch.show.history.describe_cut import contradiction_remark, cut_json, cut_text, untapped_remarks

    if stable == chatter:
        raise ValueError(f"{'both' if stable else 'neither'} of --stable and --chatter: give one, what was heard")
    logbook = Logbook.open(machine)
    setting = cut_setting(logbook.machine, program, speed, depth, power)
    heard = observe_cut(setting, "stable" if stable else "chatter", frequency, date)
    remarks = [*untapped_remarks(logbook, heard), *map(contradiction_remark, contradicting_cuts(heard, logbook.cuts))]
    with telling(logbook):
        stored = keep_cut(logbook.folder, heard)
        payload = {"cut": cut_json(stored), "remarks": [remark.code for remark in remarks]}
        emit(payload, as_json, f"saved {cut_text(stored)}")
    note_remarks(remarks)
