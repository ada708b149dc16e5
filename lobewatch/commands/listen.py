"""Command `lobewatch listen`: detect chatter in a recorded or live cut."""

import contextlib
import itertools
import sys
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Option

from lobewatch.commands.shared_options import CutDate, CutDepth, CutPower, FileOptions, Machine, add_file_options, rpm
from lobewatch.show.terminal.output import Json, Listen, Token, WatchToken, emit, notes, print_remarks, show_address

if TYPE_CHECKING:
    from acquisition.files.cut_file import CutSignal
    from lobewatch.logbook import Logbook
    from lobewatch.logbook.cut_comparison import CutComparison
    from lobewatch.tap.cut_recording import CutState
    from lobewatch.tap.state import StatePublisher


@add_file_options(without=["quantity", "force_unit", "averages", "spacing", "start", "force", "one_test", "axes"])
def listen(
    machine: Machine,
    program: Annotated[str, Option(help="Program name.")] = "",
    cut: Annotated[str, Option(help='Cut instead of a program: "reference cut", or the cut of a program.')] = "",
    speed: Annotated[
        float | None, Option(parser=rpm, help="Commanded spindle speed (rpm). Default: from the program.")
    ] = None,
    depth: CutDepth = None,
    power: CutPower = None,
    file: Annotated[Path | None, Option(help="Recording of the cut, instead of the device.")] = None,
    date: CutDate = None,
    sensor: Annotated[str, Option(help="Sensor of --file: accelerometer or microphone (no unit).")] = ("accelerometer"),
    tacho: Annotated[
        str, Option(help="Column of --file with the spindle speed (rpm or Hz) or tachometer pulses.")
    ] = "",
    pulses: Annotated[int | None, Option(min=1, help="Tachometer pulses per revolution. Default: 1.")] = None,
    port: Annotated[str, Option(help="Serial port of the DAQ. Default: [daq] port.")] = "",
    seconds: Annotated[float, Option(min=2, help="Longest wait for a cut (s).")] = 120.0,
    cuts: Annotated[
        int | None, Option(min=1, help="Number of cuts to record. Default: no limit at a terminal, else 1.")
    ] = None,
    dry_run: Annotated[bool, Option("--dry-run", help="Show the result without storing it.")] = False,
    out: Annotated[Path | None, Option(help="Spectrum figure (.svg, .png, .pdf).")] = None,
    screen: Annotated[bool, Option("--screen", help="Show the result in a browser too.")] = False,
    listen: Listen = "127.0.0.1",
    token: Token = None,
    watch_token: WatchToken = None,
    *,
    file_options: FileOptions,
    as_json: Json = False,
) -> None:
    """Record cuts and detect chatter.

    Start with the spindle running in air, then cut for at least one second. Each recording and its result are stored.
    lobewatch then waits for the next cut, until you press Ctrl-C. lobewatch exclude takes a cut out of all results.

    Examples
    --------
      lobewatch listen mill-3 --program A --port /dev/ttyACM0 --out cut.png
      lobewatch listen mill-3 --program A --screen --listen 0.0.0.0
      lobewatch listen mill-3 --program A --speed 12000 --depth 2 --file cut.wav --full-scale 500 --unit m/s^2
      lobewatch listen mill-3 --cut "reference cut" --speed 12000 --depth 2
      lobewatch listen mill-3 --program A --file cut.flac --sensor microphone
      lobewatch listen mill-3 --program A --file cut.csv --tacho "Channel 4" --pulses 2
    """
    from lobewatch.logbook import Logbook
    from lobewatch.machine.settings.requested_cut import choose_cut
    from lobewatch.show.cuts.recorded_cuts import recording_json, recording_texts
    from lobewatch.tap import cut_recording as recorder

    logbook = Logbook.open(machine)
    setting = choose_cut(logbook.machine, program, cut, speed, depth, power)
    if not dry_run:
        logbook.folder.refuse_damage()
    if screen and file is not None:
        raise ValueError("--screen needs a device instead of a file. Leave out --screen or --file.")
    description = file_options.description(**recorder.check_file_options(sensor, tacho, pulses, file))
    with contextlib.ExitStack() as screens, recorder.publish_cut_states(logbook, setting) as publisher:
        if screen:
            from lobewatch.screen import CutScreenServer  # imports aiohttp

            server = CutScreenServer(publisher, listen=listen, token=token, watch_token=watch_token)
            screens.enter_context(server)
            show_address(server.url, server.watch_url)
        signals = screens.enter_context(
            contextlib.closing(
                recorder.acquire_cut(
                    logbook.folder, setting, file, port, seconds, description, notes.print, publisher.show
                )
            )
        )
        limit = cuts or (None if notes.is_terminal and sys.stdin.isatty() else 1)
        for signal in itertools.islice(signals, limit):
            comparisons = recorder.evaluate_live_cut(logbook, setting, signal, publisher)
            if out is not None:
                from lobewatch.show.cuts.spectrum_figure import save_cut_spectrum  # imports matplotlib

                save_cut_spectrum(comparisons, out)
            if dry_run:
                emit(recording_json(comparisons), as_json, *recording_texts(comparisons))
            else:
                _store(logbook, comparisons, signal, date, publisher, as_json)


def _store(
    logbook: "Logbook",
    comparisons: "Sequence[CutComparison]",
    signal: "CutSignal",
    date: datetime | None,
    publisher: "StatePublisher[CutState]",
    as_json: bool,
) -> None:
    """Store the recorded cuts and show them."""
    from lobewatch.logbook.cut_comparison import store_recorded_cuts
    from lobewatch.notify.publish_status import publish_on_change
    from lobewatch.show.cuts.recorded_cuts import recording_json, recording_texts
    from lobewatch.show.history import saved_cut_remarks

    with publish_on_change(logbook):
        earlier, stored = logbook.cuts, store_recorded_cuts(logbook.folder, comparisons, signal, date)
        publisher.show(saved=stored[-1].id)
        remarks = [saved_cut_remarks(logbook, cut, [*earlier, *stored[:i]]) for i, cut in enumerate(stored)]
        codes = [[remark.code for remark in cut_remarks] for cut_remarks in remarks]
        rows = [{"id": cut.id, "remarks": cut_codes} for cut, cut_codes in zip(stored, codes, strict=True)]
        emit(recording_json(comparisons, rows), as_json, *recording_texts(comparisons, [cut.id for cut in stored]))
    print_remarks(itertools.chain.from_iterable(remarks))
