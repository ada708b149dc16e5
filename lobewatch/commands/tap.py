"""lobewatch tap."""

from __future__ import annotations

import contextlib
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer

from acquisition import Circumstances
from lobewatch.analysis import Logbook
from lobewatch.machine.folder import MachineFolder
from lobewatch.show.measurements import measurement_json, measurement_texts, program_texts, programs_json
from lobewatch.show.output import Json, emit, notes
from lobewatch.show.printer import TapPrinter
from lobewatch.show.show_address import Listen, Token, show_address
from lobewatch.show.terminal_screen import TerminalScreen
from lobewatch.tap.plug import Plug
from lobewatch.tap.session import TapSession, TapStopped


def tap(
    machine: Annotated[Path, typer.Argument(help="Machine folder.")],
    port: Annotated[str, typer.Option(help="Serial port of the DAQ, socket://HOST:PORT, or file:RECORDING.")] = "",
    tool: Annotated[str, typer.Option(help=r"What is in the spindle; \[tap] tool where not given.")] = "",
    direction: Annotated[str, typer.Option(help="Direction at the tool tip, x or y.")] = "x",
    operator: Annotated[str, typer.Option(help="Who holds the hammer.")] = "",
    new: Annotated[bool, typer.Option("--new", help="Begin anew, do not go on with an interrupted test.")] = False,
    screen: Annotated[bool, typer.Option("--screen", help="Show the test in a browser too.")] = False,
    listen: Listen = "127.0.0.1",
    token: Token = None,
    as_json: Json = False,
) -> None:
    """The live tap test: hit until ten hits are good, then see what has changed.

    Keys: u or Page Up takes the last good hit back, q stops, m mutes. Every hit is on the disk before it is counted.
    After a crash the same command goes on at the same hit; an unplugged cable is waited for.

    Examples:

      lobewatch tap mill-3 --port /dev/ttyACM0

      lobewatch tap mill-3 --port COM3 --direction y --operator Kim

      lobewatch tap mill-3 --screen --listen 0.0.0.0     (watched on a tablet)

      lobewatch tap trial --port file:taps/ID.h5     (recorded hits as if they were made now)
    """
    folder = MachineFolder(machine)
    setup = folder.machine
    port = port or setup.daq.port
    if not port:
        raise ValueError(f"no port: give --port, or port in [daq] of {folder.toml}")
    about = Circumstances(
        setup.machine.name,
        datetime.now(UTC),
        tool or setup.tap.tool,
        direction,
        operator,
        folder.toml.read_text("utf-8"),
    )
    session = TapSession(folder, Plug(setup.daq, port).open, about, resume=not new)
    try:
        with contextlib.ExitStack() as screens:
            if screen:
                from lobewatch.screen import ScreenServer  # brings aiohttp, which most commands do not need

                server = screens.enter_context(ScreenServer(session, listen=listen, token=token))
                show_address(server.url)
            screens.enter_context(TerminalScreen(session) if notes.is_terminal else TapPrinter(session, notes))
            done = session.run()
    except (TapStopped, KeyboardInterrupt) as stopped:
        notes.print(f"stopped with {session.state.good} good hits; the same command goes on with them")
        raise KeyboardInterrupt from stopped
    notes.print(f"saved {done.id}")
    logbook, found = Logbook(folder), session.measurement
    payload = measurement_json(found, logbook) | {"programs": programs_json(logbook.verdicts())}
    emit(payload, as_json, *measurement_texts(found, logbook), *program_texts(logbook))
