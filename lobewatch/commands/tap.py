"""lobewatch tap."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer

from acquisition import Circumstances
from lobewatch.describe import measurement_json, measurement_texts
from lobewatch.devices import open_source
from lobewatch.machine_folder import MachineFolder
from lobewatch.output import Json, emit, notes
from lobewatch.tap_printer import TapPrinter
from lobewatch.tap_session import TapSession, TapStopped


def tap(
    machine: Annotated[Path, typer.Argument(help="Machine folder.")],
    port: Annotated[str, typer.Option(help="Serial port of the DAQ, or socket://HOST:PORT.")] = "",
    tool: Annotated[str, typer.Option(help=r"What is in the spindle; \[tap] tool where not given.")] = "",
    direction: Annotated[str, typer.Option(help="Direction at the tool tip, x or y.")] = "x",
    operator: Annotated[str, typer.Option(help="Who holds the hammer.")] = "",
    new: Annotated[bool, typer.Option("--new", help="Begin anew, do not go on with an interrupted test.")] = False,
    as_json: Json = False,
) -> None:
    """The live tap test: hit until ten hits are good, then see what has changed.

    Every hit is on the disk before its verdict is shown. After a crash or an unplugged cable the same command
    goes on at the same hit.

    Examples:

      lobewatch tap mill-3 --port /dev/ttyACM0

      lobewatch tap mill-3 --port COM3 --direction y --operator Kim
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
    session = TapSession(folder, lambda: open_source(setup.daq, port), about, resume=not new)
    with TapPrinter(session, notes):
        try:
            done = session.run()
        except TapStopped as stopped:
            notes.print(str(stopped))
            raise KeyboardInterrupt from stopped
        except KeyboardInterrupt:
            notes.print(f"stopped with {session.state.good} good hits; the same command goes on with them")
            raise
    notes.print(f"saved {done.id}")
    emit(measurement_json(session.measurement, setup), as_json, *measurement_texts(session.measurement, setup))
