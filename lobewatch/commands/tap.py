"""Command `lobewatch tap`: run a live tap test."""

import contextlib
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Option

from lobewatch.commands.shared_options import Machine, open_folder
from lobewatch.show.terminal.output import Json, Listen, Token, WatchToken, notes, print_remarks, show_address

if TYPE_CHECKING:
    from lobewatch.machine import MachineFolder
    from lobewatch.tap.visit import TapVisit


def tap(
    machine: Machine,
    port: Annotated[
        str, Option(help="Serial port of the DAQ, socket://HOST:PORT, or file:RECORDING. Default: [daq] port.")
    ] = "",
    tool: Annotated[str, Option(help="Tool in the spindle. Default: [tap] tool.")] = "",
    direction: Annotated[
        str,
        Option(
            help="Only this direction at the tool tip: x, y, or xy (hit in x, sensor in y). Default: x. At a terminal, "
            "y follows x."
        ),
    ] = "",
    operator: Annotated[str, Option(help="Name of the operator.")] = "",
    new: Annotated[bool, Option("--new", help="Start a new test instead of resuming an interrupted one.")] = False,
    accept: Annotated[
        list[str] | None,
        Option(help="Accept this warning code and store the recording (repeatable)."),
    ] = None,
    temperature: Annotated[float | None, Option(help="Spindle temperature (degC).")] = None,
    hours: Annotated[float | None, Option(help="Running hours of the spindle (h).")] = None,
    note: Annotated[str, Option(help="Note on this test.")] = "",
    reclamped: Annotated[bool, Option("--reclamped", help="The tool was reclamped before this test.")] = False,
    screen: Annotated[bool, Option("--screen", help="Show the test in a browser too.")] = False,
    listen: Listen = "127.0.0.1",
    token: Token = None,
    watch_token: WatchToken = None,
    details: Annotated[bool, Option("--details", help="Show all modes, the model and uncertainties too.")] = False,
    as_json: Json = False,
) -> None:
    """Run a live tap test.

    At a terminal, or with --screen, you tap x, then y, then choose the next step. Each hit is stored at once: after a
    crash or an unplugged cable, the same command continues the test. Keys: u or Page Up undoes the last good hit, q
    stops, m mutes. a accepts and r rejects the last hit, 3a and 3r hit 3.

    Examples
    --------
      lobewatch tap mill-3 --port /dev/ttyACM0
      lobewatch tap mill-3 --port COM3 --direction y --operator Kim
      lobewatch tap mill-3 --screen --listen 0.0.0.0
      lobewatch tap mill-3 --temperature 24 --reclamped --note "after a warm-up of 20 min"
      lobewatch tap trial --port file:taps/ID.h5
    """
    from acquisition import Conditions, TapDirection, parse_direction
    from lobewatch.logbook import Logbook
    from lobewatch.notify.publish_status import publish_on_change, publish_status
    from lobewatch.show.mass_check_offer import offer_mass_check
    from lobewatch.show.measurement import emit_tap_results
    from lobewatch.show.terminal.terminal_screen import TapPrinter, TerminalScreen
    from lobewatch.tap.hit_loop import TapStopped
    from lobewatch.tap.session import TapSession, plan_session
    from lobewatch.tap.visit import TapVisit, choose_first_direction

    folder, finished = _open_folder(machine), list[TapSession]()
    conditions = Conditions(temperature_c=temperature, hours=hours, note=note, reclamped=reclamped)
    asks = (screen or (notes.is_terminal and sys.stdin.isatty())) and not port.startswith("file:")
    is_guided = asks and not (direction or as_json)

    def plan(tool: str, direction: TapDirection) -> TapSession:
        fields = {"port": port, "tool": tool, "direction": direction, "operator": operator}
        return plan_session(folder, **fields, resume=not new, accept=accept or (), asks=asks, conditions=conditions)

    def after(session: TapSession) -> None:
        finished.append(session)
        publish_status(Logbook(folder))

    tool = tool or folder.machine.tap.tool
    first = parse_direction(direction) if direction else choose_first_direction(folder, tool) if is_guided else "x"
    visit = TapVisit(plan, tool, first, leads=is_guided, after=after)
    try:
        with contextlib.ExitStack() as screens:
            if screen:
                _open_screen(screens, visit, listen, token, watch_token)
            screens.enter_context(TerminalScreen(visit) if notes.is_terminal else TapPrinter(visit, notes))
            visit.run()
    except (TapStopped, KeyboardInterrupt) as stopped:
        if not visit.is_waiting:
            notes.print(f"stopped with {visit.state.good} good hits. Run the same command again to continue the test.")
        raise KeyboardInterrupt from stopped
    emit_tap_results(Logbook(folder), finished, as_json, details)
    if is_guided and not screen:
        with publish_on_change(Logbook(folder)):
            offer_mass_check(folder, finished[-1].saved[0], port, operator)


def _open_folder(path: Path) -> "MachineFolder":
    """Open a machine folder, and print a note if another folder next to it is a copy."""
    from lobewatch.fleet.copied_folders import find_copies

    folder = open_folder(path)
    print_remarks(find_copies({path.resolve().name: path}).values())
    return folder


def _open_screen(
    screens: contextlib.ExitStack, visit: "TapVisit", listen: str, token: str | None, watch_token: str | None
) -> None:
    """Serve a visit in the browser until the context ends, and print the address."""
    from lobewatch.screen import ScreenServer  # imports aiohttp

    server = screens.enter_context(ScreenServer(visit, listen=listen, token=token, watch_token=watch_token))
    show_address(server.url, server.watch_url)
