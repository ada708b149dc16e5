"""Command `lobewatch listen`: detect chatter in a recorded or live cut."""

import contextlib
import itertools
import sys
import time
from collections.abc import Iterable, Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Never

from typer import Context, Option

from lobewatch.commands.shared_options import (
    CutDate,
    CutDepth,
    CutPower,
    FileOptions,
    Flutes,
    FolderArgument,
    add_file_options,
    allow_options,
    find_recording,
    parse_speeds,
    reject_options,
    rpm,
)
from lobewatch.show.terminal.output import (
    HttpPort,
    Json,
    Listen,
    Token,
    WatchToken,
    emit,
    notes,
    print_remarks,
    show_address,
)

if TYPE_CHECKING:
    from acquisition import Description
    from acquisition.files.cut_file import CutSignal
    from lobewatch.logbook import Logbook
    from lobewatch.logbook.cut_comparison import CutComparison
    from lobewatch.logbook.heard_cuts import CutFileRequest
    from lobewatch.screen.web_server import ServerOptions
    from lobewatch.tap.cut_recording import CutState
    from lobewatch.tap.state import StatePublisher


SERVER_OPTIONS = ("listen", "http_port", "token", "watch_token")
"""Names of the options on a server of pages."""
DEVICE_OPTIONS = ("port", "seconds", "cuts", "screen")
"""Names of the options on a recording with a device."""
HEARD_OPTIONS = ("machine", "teeth", "speed", "speeds", "depth", "tacho", "pulses", "out", "dry_run")
"""Names of the options on a recorded cut of any machine, besides those on a file."""


@add_file_options(without=["quantity", "force_unit", "averages", "spacing", "start", "force", "one_test", "axes"])
def listen(
    ctx: Context,
    machine: Annotated[
        Path | None, FolderArgument(help="Machine folder, or a recorded cut of any machine. Not with --page.")
    ] = None,
    program: Annotated[str, Option(help="Program name.")] = "",
    cut: Annotated[str, Option(help='Cut instead of a program: "reference cut", or the cut of a program.')] = "",
    speed: Annotated[
        float | None, Option(parser=rpm, help="Commanded spindle speed (rpm). Default: from the program.")
    ] = None,
    depth: CutDepth = None,
    power: CutPower = None,
    teeth: Flutes = None,
    speeds: Annotated[
        str, Option(help='Speeds of the machine (rpm): "8000-24000". Default: 0.5 to 1.5 times --speed.')
    ] = "",
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
    page: Annotated[bool, Option("--page", help="Serve a page that takes recordings of a phone.")] = False,
    listen: Listen = "127.0.0.1",
    http_port: HttpPort = 0,
    token: Token = None,
    watch_token: WatchToken = None,
    *,
    file_options: FileOptions,
    as_json: Json = False,
) -> None:
    """Record cuts and detect chatter.

    Start with the spindle running in air, then cut for at least one second. Each recording and its result are stored.
    lobewatch then waits for the next cut, until you press Ctrl-C. lobewatch exclude takes a cut out of all results.

    A recorded cut instead of a machine folder needs --teeth and --speed. The result is not stored.

    Examples
    --------
      lobewatch listen cut.wav --teeth 2 --speed 18000 --speeds 8000-24000 --depth 1
      lobewatch listen mill-3 --program A --port /dev/ttyACM0 --out cut.png
      lobewatch listen mill-3 --program A --screen --listen 0.0.0.0
      lobewatch listen mill-3 --program A --speed 12000 --depth 2 --file cut.wav --full-scale 500 --unit m/s^2
      lobewatch listen mill-3 --cut "reference cut" --speed 12000 --depth 2
      lobewatch listen mill-3 --program A --file cut.flac --sensor microphone
      lobewatch listen mill-3 --program A --file cut.csv --tacho "Channel 4" --pulses 2
      lobewatch listen --page --listen 0.0.0.0 --http-port 8080
    """
    server: ServerOptions = {"listen": listen, "port": http_port, "token": token, "watch_token": watch_token}
    if page:
        allow_options(ctx, ["page", *SERVER_OPTIONS], "does not apply to --page")
        _serve_page(as_json, server)
    machine = find_recording(machine)
    from lobewatch.logbook import Logbook
    from lobewatch.logbook.heard_cuts import CutFileRequest
    from lobewatch.machine.settings.requested_cut import choose_cut
    from lobewatch.show.listen_answers import unstored_answer
    from lobewatch.tap import cut_recording as recorder

    if machine.is_file():
        allow_options(ctx, [*HEARD_OPTIONS, *vars(file_options)], "needs a machine folder")
        description = file_options.description(tacho=tacho, pulses=pulses)
        request = CutFileRequest(teeth, speed, depth, parse_speeds(speeds) if speeds else None)
        _listen_to_file(machine, description, request, out, as_json)
        return
    _reject_folder_options(ctx, vars(file_options), has_file=file is not None, screen=screen)
    logbook = Logbook.open(machine)
    setting = choose_cut(logbook.machine, program, cut, speed, depth, power)
    if not dry_run:
        logbook.folder.refuse_damage()
    description = file_options.description(**recorder.check_file_options(sensor, tacho, pulses, file))
    with contextlib.ExitStack() as screens, recorder.publish_cut_states(logbook, setting) as publisher:
        if screen:
            from lobewatch.screen import CutScreenServer  # imports aiohttp

            shown = screens.enter_context(CutScreenServer(publisher, **server))
            show_address(shown.url, shown.watch_url)
        how = file, port, seconds, description, notes.print, publisher.show
        signals = screens.enter_context(contextlib.closing(recorder.acquire_cut(logbook.folder, setting, *how)))
        limit = cuts or (None if notes.is_terminal and sys.stdin.isatty() else 1)
        for signal in itertools.islice(signals, limit):
            comparisons = recorder.evaluate_live_cut(logbook, setting, signal, publisher)
            _save_figure(comparisons, out)
            if dry_run:
                payload, texts = unstored_answer(logbook, comparisons)
                emit(payload, as_json, *texts)
            else:
                _store(logbook, comparisons, signal, date, publisher, as_json)


def _reject_folder_options(ctx: Context, file_options: Iterable[str], *, has_file: bool, screen: bool) -> None:
    """Raise ValueError for an option that does not apply to a cut of a machine folder."""
    reject_options(ctx, ["teeth", "speeds"], "works only with a recorded cut instead of a machine folder")
    if has_file:
        reject_options(ctx, DEVICE_OPTIONS, "needs a device instead of --file")
    else:
        reject_options(ctx, file_options, "works only with --file")
    if not screen:
        reject_options(ctx, SERVER_OPTIONS, "works only with --screen or --page")


def _serve_page(as_json: bool, options: "ServerOptions") -> Never:
    """Serve the page that takes recordings of a phone, until Ctrl-C."""
    from lobewatch.screen import RecordingServer  # imports aiohttp

    with RecordingServer(**options) as server:
        show_address(server.url, server.watch_url, as_json)
        while True:
            time.sleep(1)


def _save_figure(comparisons: "Sequence[CutComparison]", out: Path | None) -> None:
    if out is not None:
        from lobewatch.show.cuts.spectrum_figure import save_cut_spectrum  # imports matplotlib

        save_cut_spectrum(comparisons, out)


def _listen_to_file(
    path: Path, description: "Description", request: "CutFileRequest", out: Path | None, as_json: bool
) -> None:
    """Evaluate a recorded cut of an unknown machine, and show the next speeds."""
    from lobewatch.logbook.heard_cuts import hear_file
    from lobewatch.show.listen_answers import file_answer

    comparisons, found = hear_file(path, description, request)
    _save_figure(comparisons, out)
    payload, texts = file_answer(comparisons, found)
    emit(payload, as_json, *texts)


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
    from lobewatch.show.listen_answers import stored_answer

    with publish_on_change(logbook):
        earlier, stored = logbook.cuts, store_recorded_cuts(logbook.folder, comparisons, signal, date)
        publisher.show(saved=stored[-1].id)
        payload, texts, remarks = stored_answer(logbook, comparisons, earlier, stored)
        emit(payload, as_json, *texts)
    print_remarks(remarks)
