"""lobewatch emulate: a command for every driver that can be emulated."""

from __future__ import annotations

import json
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from lobewatch.machine.named_folder import named_folder
from lobewatch.show.output import Json, notes, results

if TYPE_CHECKING:
    from dsm import Spindle
    from lobewatch.machine import MachineFolder

StoryName = Literal["steady", "step", "accelerating", "replaced", "none"]
emulate = typer.Typer(help="A data acquisition device made of software, on a pseudo-terminal.", no_args_is_help=True)

Machine = Annotated[
    Path, typer.Argument(parser=named_folder, help="Machine folder with a spindle in its machine.toml: what is hit.")
]
Tcp = Annotated[bool, typer.Option("--tcp", help="On a TCP port of this computer instead.")]
Fast = Annotated[bool, typer.Option("--fast", help="As fast as the host reads, not in real time.")]
Seed = Annotated[int, typer.Option(help="Of the random numbers.")]
Told = Annotated[StoryName, typer.Option("--story", help="What befalls the bearings over 24 months.")]
Month = Annotated[int, typer.Option("--month", min=0, max=60, help="Of the story, in which it is tapped.")]
Scatter = Annotated[float, typer.Option(help="Scatter of f_1 by remounting: standard deviation, 0 to 5 %.")]
Bad = Annotated[float, typer.Option("--bad-clampings", help="Chance that it is clamped badly: f_1 2 % low, 0 to 50 %.")]
Warm = Annotated[float | None, typer.Option("--temperature", help="Swing over the year, 0 to 30 K; f_1 moves with it.")]
MONTHS = 24
"""Of a story."""


def _add_commands() -> None:
    from acquisition.devices import driver_names, find_driver
    from acquisition.errors import DataError

    for name in driver_names():
        try:
            driver = find_driver(name)
        except DataError as error:  # said here, and again by the command
            emulate.command(name, help=f"{error}.")(_in_real_time(name))
            continue
        if driver.emulate is not None:
            run = _with_fast(name) if driver.emulates_fast else _in_real_time(name)
            emulate.command(name, help=_help(name, driver.title))(run)


def _with_fast(name: str) -> Callable[..., None]:
    def run(
        machine: Machine,
        tcp: Tcp = False,
        fast: Fast = False,
        seed: Seed = 1,
        story: Told = "none",
        month: Month = 0,
        scatter: Scatter = 0.0,
        bad: Bad = 0.0,
        warm: Warm = None,
        as_json: Json = False,
    ) -> None:
        _serve(name, machine, tcp, fast, seed, as_json, (story, month, scatter, bad, warm))

    return run


def _in_real_time(name: str) -> Callable[..., None]:
    def run(
        machine: Machine,
        tcp: Tcp = False,
        seed: Seed = 1,
        story: Told = "none",
        month: Month = 0,
        scatter: Scatter = 0.0,
        bad: Bad = 0.0,
        warm: Warm = None,
        as_json: Json = False,
    ) -> None:
        _serve(name, machine, tcp, False, seed, as_json, (story, month, scatter, bad, warm))

    return run


def _help(name: str, title: str) -> str:
    return (
        f"{title[:1].upper()}{title[1:]} with somebody who taps twice a second; Ctrl-C ends it.\n\nExamples:\n\n"
        f"  lobewatch emulate {name} trial\n  lobewatch tap trial --port /dev/pts/3  # in another window"
    )


Asked = tuple[StoryName, int, float, float, float | None]
"""Story, month, scatter (%), chance of a bad clamping (%), swing of the temperature (K)."""


def _serve(name: str, machine: Path, tcp: bool, fast: bool, seed: int, as_json: bool, asked: Asked) -> None:
    """Say where it is, and serve until Ctrl-C."""
    from acquisition.devices import find_driver
    from lobewatch.machine.folder import MachineFolder
    from lobewatch.tap.emulated_spindle import emulate_machine

    folder = MachineFolder(machine)
    spindle = _spindle(folder, asked, seed)
    emulated = emulate_machine(folder, find_driver(name), seed, realtime=not fast, tcp=tcp, spindle=spindle)
    with emulated.device as device:
        truth = {"frequency_hz": emulated.frequency, "stiffness_n_per_m": emulated.stiffness}
        results.print(json.dumps({"port": device.port, **truth}) if as_json else f"port {device.port}", markup=False)
        results.file.flush()
        notes.print(f"the truth: f_1 {emulated.frequency:.2f} Hz, K {emulated.stiffness / 1e6:.3f} N/um")
        notes.print(
            f"tap with: lobewatch tap {shlex.quote(str(machine))} --port {device.port}   (Ctrl-C ends the emulator)",
            markup=False,
        )
        device.wait()


def _spindle(folder: MachineFolder, asked: Asked, seed: int) -> Spindle | None:
    """As it is mounted in that month; None for that of machine.toml as it stands there."""
    from lobewatch.tap.stories.mounted import mounted_at
    from lobewatch.tap.stories.mounting import Mounting
    from lobewatch.tap.stories.story import Story

    story, month, scatter, bad, warm = asked
    mounting = Mounting(scatter / 100, bad / 100, warm)
    mounting.check()
    if story == "none" and not any(mounting):
        return None
    return mounted_at(folder, Story(story), MONTHS, month, mounting, seed)


_add_commands()
