"""lobewatch tap."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer

from acquisition import Circumstances, Hit, HitFlags
from lobewatch.describe import measurement_json, measurement_texts
from lobewatch.devices import open_source
from lobewatch.history import update_history
from lobewatch.machine_folder import MachineFolder
from lobewatch.output import Json, emit, notes
from lobewatch.tapping import OnHit, begin_tap, take_hits, trigger_for


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
    with folder.locked():
        running = begin_tap(folder, about, resume=not new)
        if running.hits:
            begun = f"{running.circumstances.created:%Y-%m-%d %H:%M} UTC"
            notes.print(f"going on with the test begun {begun}: {running.good} of {setup.tap.hits} good hits are there")
        try:
            with open_source(setup.daq, port) as source:
                device = f"{source.info['model']} on {port}, {source.sample_rate:g} Hz"
                notes.print(f"{device}. TAP the tool, again and again.", markup=False)
                take_hits(
                    running, source, trigger_for(folder, source.sample_rate), setup.tap.hits, _show(setup.tap.hits)
                )
        except KeyboardInterrupt:
            notes.print(f"stopped with {running.good} good hits; the same command goes on with them")
            raise
        folder.commit(running.finish())
        notes.print(f"saved {running.id}")
        _, measurements = update_history(folder)
    found = next(measurement for measurement in measurements if measurement.tap_id == running.id)
    emit(measurement_json(found, setup), as_json, *measurement_texts(found, setup))


def _show(wanted: int) -> OnHit:
    def on_hit(hit: Hit, flags: HitFlags, good: int) -> None:
        verdict = f"[bold red]✗ {flags.words.upper()}[/]  {flags.cure}" if flags else "[bold green]✓ GOOD[/]"
        notes.print(f"{good:3d} / {wanted}  {verdict}  ({hit.force.max():.0f} N)")

    return on_hit
