"""lobewatch tap."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Annotated

import typer

from lobewatch.machine.folder_path import named_folder
from lobewatch.show.terminal.output import Json, emit, notes
from lobewatch.show.terminal.show_address import Listen, Token, WatchToken, serving


def tap(
    machine: Annotated[Path, typer.Argument(parser=named_folder, help="Machine folder.")],
    port: Annotated[str, typer.Option(help="Serial port of the DAQ, socket://HOST:PORT, or file:RECORDING.")] = "",
    tool: Annotated[str, typer.Option(help="What is in the spindle; [tap] tool where not given.")] = "",
    direction: Annotated[str, typer.Option(help="Direction at the tool tip, x or y.")] = "x",
    operator: Annotated[str, typer.Option(help="Who holds the hammer.")] = "",
    new: Annotated[bool, typer.Option("--new", help="Begin anew, do not go on with an interrupted test.")] = False,
    accept: Annotated[
        list[str] | None,
        typer.Option(help="Take the recording though it raises this question, by its code; as often as needed."),
    ] = None,
    temperature: Annotated[float | None, typer.Option(help="Of the spindle, degC.")] = None,
    hours: Annotated[float | None, typer.Option(help="Running hours of the spindle, h.")] = None,
    note: Annotated[str, typer.Option(help="What else is to be remembered of this test.")] = "",
    reclamped: Annotated[bool, typer.Option("--reclamped", help="The tool was clamped anew for this test.")] = False,
    screen: Annotated[bool, typer.Option("--screen", help="Show the test in a browser too.")] = False,
    listen: Listen = "127.0.0.1",
    token: Token = None,
    watch_token: WatchToken = None,
    as_json: Json = False,
) -> None:
    """The live tap test: hit until ten hits are good, then see what has changed.

    Keys: u or Page Up takes the last good hit back, q stops, m mutes. Every hit is on the disk before it is counted.
    After a crash the same command goes on at the same hit; an unplugged cable is waited for. --screen --listen 0.0.0.0
    can be watched on a tablet; --port file:RECORDING takes recorded hits as if they were made now.

    Examples:

      lobewatch tap mill-3 --port /dev/ttyACM0
      lobewatch tap mill-3 --port COM3 --direction y --operator Kim
      lobewatch tap mill-3 --screen --listen 0.0.0.0
      lobewatch tap mill-3 --temperature 24 --reclamped --note "after a warm-up of 20 min"
      lobewatch tap trial --port file:taps/ID.h5
    """
    from acquisition import Conditions
    from lobewatch.logbook import Logbook
    from lobewatch.machine import MachineFolder
    from lobewatch.measuring.questions import unasked_text
    from lobewatch.notify.telling import tell
    from lobewatch.show.history.describe_measurement import measurement_json, measurement_texts
    from lobewatch.show.programs.describe_verdicts import program_texts, programs_json
    from lobewatch.show.terminal.printer import TapPrinter
    from lobewatch.show.terminal.terminal_screen import TerminalScreen
    from lobewatch.tap.hit_loop import TapStopped
    from lobewatch.tap.session import plan_session

    folder = MachineFolder(machine)
    conditions = Conditions(temperature_c=temperature, hours=hours, note=note, reclamped=reclamped)
    named = {"port": port, "tool": tool, "direction": direction, "operator": operator}
    session = plan_session(folder, **named, resume=not new, accept=accept or (), conditions=conditions)
    try:
        with contextlib.ExitStack() as screens:
            if screen:
                from lobewatch.screen import ScreenServer  # brings aiohttp, which most tap tests do not need

                server = ScreenServer(session, listen=listen, token=token, watch_token=watch_token)
                screens.enter_context(serving(server))
            screens.enter_context(TerminalScreen(session) if notes.is_terminal else TapPrinter(session, notes))
            done = session.run()
    except (TapStopped, KeyboardInterrupt) as stopped:
        notes.print(f"stopped with {session.state.good} good hits; the same command goes on with them")
        raise KeyboardInterrupt from stopped
    notes.print(f"saved {done.id}")
    accepted = [remark.about for remark in session.measurement.remarks if remark.code == "accepted"]
    notes.print(*(f"accepted: {code}" for code in accepted), sep="\n", end="\n" if accepted else "")
    logbook, measurement = Logbook(folder), session.measurement
    if session.unasked:
        notes.print(unasked_text(session.unasked, [done.id], logbook.questions), markup=False)
    payload = measurement_json(measurement, logbook) | {"programs": programs_json(logbook.verdicts())}
    emit(payload, as_json, *measurement_texts(measurement, logbook), *program_texts(logbook))
    tell(logbook)
